# SPDX-License-Identifier: Apache-2.0
"""A flight of a spinning payload as its estimators saw it: passages, attitudes, coning; from topics or a recording."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from css_common.attitude import mrp_to_dcm, quaternion_to_mrp
from css_common.codec import Sample, codec_of, type_name
from css_common.epochs import mission_epoch
from css_common.link import is_gap
from css_common.mission import Mission, mission_from_text
from css_common.schema import Values
from css_estimation.spin.coning import Passages
from css_estimation.spin.slit_passage import REASON_NONE, REASONS
from css_msgs.msg import AttitudeEstimate, ConingEstimate, SlitSunAngle
from css_recording.bag_reader import BagReader
from css_sensors.slits import counts_between, head_azimuths, timer_frequency

UNNAMED = "before another one in the same cycle, which is the one that is named"
"""Reason of a refusal of which a message tells no more than that it was."""
TYPES = (SlitSunAngle, AttitudeEstimate, ConingEstimate)
"""What the estimators of a spinning payload publish."""


@dataclass
class SpinFlight:
    """Estimates of one flight.

    Attributes:
        mission: what flew.
        passages: accepted; times [s] count from the mission's epoch.
        attitudes: `AttitudeEstimate` messages that are new, in the order of time.
        coning: `ConingEstimate` messages at the end of a leg, by leg.
        refused: pulses and passages refused.
        reasons: refusals by reason; together they are `refused`.
    """

    mission: Mission
    passages: Passages
    attitudes: list[Sample]
    coning: dict[int, Sample]
    refused: int
    reasons: Counter[str]

    def attitude_times(self) -> np.ndarray:
        """(A,) instants [s after the epoch] of the attitudes."""
        return np.array([(a.stamp_ns - self.mission.epoch_ns) * 1e-9 - a.delay for a in self.attitudes])


def read_spinning(bag: Path) -> SpinFlight | None:
    """The flight of a recording; None when it holds no Sun angles of slits or no mission.

    Raises:
        BagError: the recording cannot be read.
        MissionError: its mission is not valid here.
    """
    with BagReader(bag) as reader:
        text = reader.mission_text
        names = {type_name(kind): kind for kind in TYPES}
        topics = {topic.name: names[topic.type] for topic, _ in reader.topics if topic.type in names}
        if text is None or SlitSunAngle not in topics.values():
            return None
        samples: dict[type, list[Sample]] = {kind: [] for kind in TYPES}
        for message in reader.messages(topics):
            kind = topics[message.topic]
            if not is_gap(message.data):
                samples[kind].append(codec_of(kind).decode(message.data))
        return spin_flight(mission_from_text(text, f"{bag}: mission"), samples)


def spin_flight(mission: Mission, samples: Mapping[type, Sequence[Sample]]) -> SpinFlight:
    """The flight that these messages tell of."""
    angles = samples.get(SlitSunAngle, ())
    coning = [c for c in samples.get(ConingEstimate, ()) if c.validity == ConingEstimate.VALIDITY_VALID and c.complete]
    return SpinFlight(
        mission,
        passages_of(angles, mission.values),
        [a for a in samples.get(AttitudeEstimate, ()) if a.validity == AttitudeEstimate.VALIDITY_VALID],
        {int(c.leg): c for c in coning},
        int(angles[-1].refused) if angles else 0,
        _reasons(angles),
    )


def _reasons(angles: Sequence[Sample]) -> Counter[str]:
    """Refusals by reason. A message counts all and names the last of its cycle; what came before that has no name."""
    reasons: Counter[str] = Counter()
    before = 0
    for angle in angles:
        new = int(angle.refused) - before
        before = int(angle.refused)
        if new > 0:
            named = angle.reason != REASON_NONE
            reasons[REASONS[angle.reason] if named else UNNAMED] += 1
            reasons[UNNAMED] += new - 1
    return +reasons


def passages_of(angles: Sequence[Sample], values: Values) -> Passages:
    """Passages of `SlitSunAngle` messages (sections mission and slits)."""
    epoch_ns, frequency = mission_epoch(values.mission), timer_frequency(values)
    azimuths = np.asarray(head_azimuths(values))
    new = [a for a in angles if a.validity == SlitSunAngle.VALIDITY_VALID]
    time = np.array([(a.stamp_ns - epoch_ns) * 1e-9 - a.age for a in new])
    order = np.argsort(time, kind="stable")
    upper = np.array([counts_between(a.upper, a.vertical) for a in new]) / frequency
    columns = (
        time,
        np.array([a.sun_angle for a in new]),
        np.array([a.rate for a in new]),
        upper,
        upper + np.array([a.count for a in new]) / frequency,
        azimuths[[a.head for a in new]] if new else np.zeros(0),
    )
    return Passages(*(column[order] for column in columns))


def attitude_matrix(q_bn: np.ndarray) -> np.ndarray:
    """(3, 3) dcm_bn of a quaternion (4,), scalar last."""
    x, y, z, w = q_bn.tolist()
    return np.array(mrp_to_dcm(quaternion_to_mrp((x, y, z, w))))
