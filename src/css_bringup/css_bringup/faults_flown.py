# SPDX-License-Identifier: Apache-2.0
"""The faults of a flight for its last lines: those that nodes told, and those that somebody set and no node told."""

from collections.abc import Iterator
from pathlib import Path

from css_analysis.fault_record import fault_texts
from css_analysis.flight_log import FlightLog
from css_bringup.flight_changes import PARAMETER_EVENTS, read_setting
from css_common.fault_lines import FAULTS
from css_common.link_kinds import LINK_FAULTS
from css_recording.bag_reader import BagReader


def faults_flown(log: FlightLog, bag: Path) -> list[str]:
    """A line for each fault of a recorded flight."""
    return [*fault_texts(log.faults), *_untold(log, bag)]


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
