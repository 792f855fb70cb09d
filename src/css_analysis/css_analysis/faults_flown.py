# SPDX-License-Identifier: Apache-2.0
"""The faults of a flight for its last lines: those that nodes told, and those that somebody set and no node told."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from css_analysis.fault_record import fault_texts
from css_analysis.flight_log import FlightLog
from css_analysis.health_record import Detection, HealthRecord, detections, untold_record
from css_analysis.unit_spells import CONTROL, held_spells
from css_common.fault_lines import FAULTS
from css_common.link_kinds import LINK_FAULTS
from css_recording.bag_reader import BagReader
from css_recording.parameter_events import PARAMETER_EVENTS, read_setting


class FaultsFlown(NamedTuple):
    """What failed in a flight, and what was found of it."""

    faults: list[str]  # a line for each fault
    detections: list[Detection]

    @property
    def warnings(self) -> list[str]:
        """A line for each unit that was held for failed and did not fail."""
        false = [found.health for found in self.detections if found.health is not None and found.is_false]
        return [f"{h.node} held {h.target} for failed at {h.begin_s:g} s, on which no fault acts" for h in false]

    def objects(self) -> list[dict[str, Any]]:
        """The detections as plain data."""
        return [
            {
                **_plain(found.health),
                "fault": None if found.fault is None else found.fault.text(),
                "after_s": found.after_s,
                "false": found.is_false,
            }
            for found in self.detections
        ]


def _plain(record: HealthRecord | None) -> dict[str, Any]:
    return {name: getattr(record, name, None) for name in HealthRecord._fields if name != "names"}


NOTHING_FLOWN = FaultsFlown([], [])


def faults_flown(log: FlightLog, bag: Path) -> FaultsFlown:
    """The faults of a recorded flight."""
    untold = list(_untold(log, bag))
    truth_known = log.truth is not None and not log.imported and not untold
    held = [*log.health, *_held_untold(log)]
    return FaultsFlown([*fault_texts(log.faults), *untold], detections(held, log.faults, truth_known))


def _held_untold(log: FlightLog) -> Iterator[HealthRecord]:
    """What was left out by nodes that tell no reasons."""
    tell = {record.node for record in log.health}
    for spell in held_spells(log):
        if spell.by not in tell and not (spell.by == CONTROL and tell - log.estimates.keys()):
            yield untold_record(spell.by, spell.target, spell.begin_s, spell.end_s)


def _untold(log: FlightLog, bag: Path) -> Iterator[str]:
    """Faults that were set in flight at nodes that tell none."""
    with BagReader(bag) as reader:
        topics = {topic.name for topic, _ in reader.topics}
        if PARAMETER_EVENTS not in topics:
            return
        for message in reader.messages([PARAMETER_EVENTS]):
            setting = read_setting(message.data, message.stamp_ns)
            told_on = f"/{FAULTS.name}/{setting.node}"
            for name, topic in ((FAULTS.name, told_on), (LINK_FAULTS.name, f"{told_on}/link")):
                if name in setting.values and topic not in topics:
                    lines = ", ".join(setting.values[name]) or "none any more"
                    about = (setting.stamp_ns - log.epoch_ns) / 1e9
                    yield f"{setting.node}: {lines}; set in flight at about {about:g} s"
