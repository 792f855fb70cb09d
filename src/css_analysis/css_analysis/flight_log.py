# SPDX-License-Identifier: Apache-2.0
"""One flight as columns: the truth, every estimate of the Sun or the attitude, cells, wheels and control.

It is read from a recording (`read_flight`) or flown in this process (`css_monte_carlo.direct_flight`). Topics are
recognised by their message type, so recordings of other vehicles and under other names work as long as they
carry Sunpoint's types. Nothing is required: without truth there are no errors to tell, without control no
modes.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from css_analysis.fault_record import FaultRecord, fault_records
from css_analysis.flight_topics import (
    ESTIMATES,
    LOGGED_TYPES,
    SINGLE,
    TOLD_TYPES,
    TRUE_WHEELS,
    estimator_of,
)
from css_analysis.health_record import HealthRecord, health_records
from css_common.attitude import mrp_to_dcm
from css_common.codec import Codec, DecodeError, Sample, codec_of, type_name
from css_common.fault_lines import Units
from css_common.kernel import kernel
from css_common.link import is_gap
from css_common.message_columns import Columns, stack
from css_common.mission import Mission, MissionError, mission_from_text
from css_common.sections import SPACECRAFT
from css_common.sensor_inputs import measures_rates
from css_common.vectors import multiply, row
from css_msgs.msg import AttitudeEstimate, Faults, Health, SunEstimate, WheelState
from css_recording.errors import BagError
from css_recording.provenance import IMPORTED_FROM

SUNLIT_FRACTION = 0.5
"""The flight is sunlit while more than this fraction of the solar disc is in view."""

_ARRAY_NORMAL = next(p for p in SPACECRAFT if p.name == "spacecraft.array_normal")


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles [rad] between the rows of two (M, 3) arrays (or one vector), accurate near 0 and pi alike."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


@kernel
def _turned_to_body(sigma_bn, vectors_n, vectors_b_out) -> None:
    for i in range(sigma_bn.shape[0]):
        v = multiply(mrp_to_dcm(row(sigma_bn, i)), row(vectors_n, i))
        vectors_b_out[i, 0], vectors_b_out[i, 1], vectors_b_out[i, 2] = v


def to_body(sigma_bn: np.ndarray, vectors_n: np.ndarray) -> np.ndarray:
    """Components in b, (M, 3), of vectors (M, 3) given in n, for attitudes sigma_bn (M, 3)."""
    vectors_b = np.empty_like(vectors_n)
    _turned_to_body(sigma_bn, vectors_n, vectors_b)
    return vectors_b


@dataclass
class FlightLog:
    """One flight. Columns hold the fields of their messages, in SI units and radians, in the order of time.

    Attributes:
        origin: where it comes from, for messages and titles.
        mission: what flew, None when unknown.
        truth: `SpacecraftState` columns, None for telemetry of a real vehicle.
        estimates: name of the estimator to `SunEstimate` columns.
        attitudes: name of the attitude filter to `AttitudeEstimate` columns.
        voltages, wheels, torque_command, rod_command, control: columns of the topic, None when there is none.
        true_wheels: `WheelState` columns with the true speeds, None where those reported are true.
        faults: those that sensors and actuators told of, node by node.
        health: units that estimators and control held for failed, node by node.
        notes: what could not be read, one line each.
        imported: it is a table of telemetry, of whose solar arrays nothing is known.
        known_truth: parts of its truth that the table has (sun, attitude, rate, position, illumination).
    """

    origin: str
    mission: Mission | None = None
    truth: Columns | None = None
    estimates: dict[str, Columns] = field(default_factory=dict)
    attitudes: dict[str, Columns] = field(default_factory=dict)
    voltages: Columns | None = None
    wheels: Columns | None = None
    torque_command: Columns | None = None
    rod_command: Columns | None = None
    control: Columns | None = None
    true_wheels: Columns | None = None
    faults: list[FaultRecord] = field(default_factory=list)
    health: list[HealthRecord] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    imported: bool = False
    known_truth: frozenset[str] = frozenset()

    def knows(self, part: str) -> bool:
        """Whether a part of the truth is known; the fields of others hold what stands for nothing."""
        return self.truth is not None and (not self.imported or part in self.known_truth)

    def columns(self) -> list[Columns]:
        """All columns of the log, none of them empty."""
        single = [getattr(self, name) for name in SINGLE]
        estimates = [*self.estimates.values(), *self.attitudes.values()]
        return [columns for columns in (*single, *estimates) if columns is not None]

    def add(self, topic: str, message_type: type, columns: Columns) -> None:
        """Take the messages of a topic; types that no log holds, and topics without messages, are ignored.

        Of several topics of a type that a flight has once, that under Sunpoint's own name is kept, else the first.
        """
        if len(columns) == 0:
            return
        if message_type in ESTIMATES:
            attribute, _ = ESTIMATES[message_type]
            getattr(self, attribute)[estimator_of(topic)] = columns
            return
        if topic == TRUE_WHEELS and message_type is WheelState:
            self.true_wheels = columns
            return
        for attribute, (kind, usual) in SINGLE.items():
            if kind is not message_type:
                continue
            taken = getattr(self, attribute) is not None
            if taken:
                self.notes.append(f"of several topics with {kind.__name__} one is taken, {usual} if it is there")
            if not taken or topic == usual:
                setattr(self, attribute, columns)

    def tell(self, topic: str, message_type: type, told: Iterable[Sample]) -> None:
        """Take the messages of a topic that tells of units that fail, of one of `TOLD_TYPES`."""
        if message_type is Faults:
            self.faults += fault_records(told, self.epoch_ns, _names_on(topic, self.mission))
        elif message_type is Health:
            self.health += health_records(topic.rpartition("/")[2], told, self.epoch_ns)

    @cached_property
    def epoch_ns(self) -> int:
        """Instant from which `time` counts: the mission's epoch, else the first stamp of the log."""
        if self.mission is not None:
            return self.mission.epoch_ns
        return min((int(columns.stamp_ns[0]) for columns in self.columns()), default=0)

    def having(self, topic: str) -> Columns:
        """The columns called `topic` (`truth`, `wheels`, ...), where the log must have them.

        Raises:
            ValueError: it has none.
        """
        columns = getattr(self, topic)
        if columns is None:
            raise ValueError(f"{self.origin}: the flight has no {topic}")
        return columns

    def time(self, columns: Columns) -> np.ndarray:
        """Time [s] of each row since the epoch."""
        return (columns.stamp_ns - self.epoch_ns) * 1e-9

    @property
    def name(self) -> str:
        """Name of the mission, else of the recording."""
        return self.mission.name if self.mission is not None else Path(self.origin).name

    @cached_property
    def array_normal_b(self) -> np.ndarray:
        """(3,) normal of the solar arrays; z when the mission is unknown."""
        if self.mission is not None:
            return self.mission.values.spacecraft.array_normal
        return _ARRAY_NORMAL.shaped(_ARRAY_NORMAL.default)

    @cached_property
    def flown(self) -> str | None:
        """Name of the estimator that the control listened to; None without control or when unknown."""
        controlled = any(c is not None for c in (self.control, self.torque_command, self.rod_command))
        if self.mission is None or not controlled:
            return None
        return self.mission.values.graph.estimator

    def uses_gyro(self, name: str) -> bool:
        """Whether an estimator may use a gyro that is there, by its parameter; of an unknown node, whether it did."""
        nodes = self.mission.nodes if self.mission is not None else ()
        for node in nodes:
            if node.name == name and hasattr(node.values, "use_gyro"):
                return bool(node.values.use_gyro and self.had_gyro(name))
        return self._went_by_gyro(name)

    def had_gyro(self, name: str) -> bool:
        """Whether an estimator had a gyro: one is in the mission, or it took rates from one."""
        return (self.mission is not None and measures_rates(self.mission.nodes)) or self._went_by_gyro(name)

    def _went_by_gyro(self, name: str) -> bool:
        """Whether an estimator ever took its rates from a gyro."""
        if name in self.attitudes:
            return bool(np.any(self.attitudes[name].used & AttitudeEstimate.USED_GYRO))
        return bool(np.any(self.estimates[name].rate_source == SunEstimate.RATE_GYRO))

    @cached_property
    def period(self) -> float:
        """Time [s] from one step of the truth to the next; 0 with fewer than two steps."""
        if self.truth is None or len(self.truth) < 2:
            return 0.0
        return float(np.median(np.diff(self.truth.stamp_ns))) * 1e-9

    @cached_property
    def sun_b(self) -> np.ndarray:
        """(M, 3) true direction to the Sun in b at every step of the truth."""
        truth = self.having("truth")
        return to_body(truth.sigma_bn, truth.sun_n)

    @cached_property
    def sunlit(self) -> np.ndarray:
        """(M,) True at steps of the truth with more than half of the solar disc in view."""
        return self.having("truth").illumination > SUNLIT_FRACTION

    @cached_property
    def pointing_error(self) -> np.ndarray:
        """(M,) angle [rad] between the array normal and the true Sun at every step of the truth."""
        return angle(self.sun_b, self.array_normal_b)

    @cached_property
    def rate(self) -> np.ndarray:
        """(M,) norm of the true body rate [rad/s]."""
        return np.linalg.norm(self.having("truth").omega_bn_b, axis=1)

    def truth_rows(self, columns: Columns) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of rows that belong to one instant: rows of `columns`, rows of the truth.

        Stamps of one flight agree exactly; those of devices with own clocks belong to the nearest step of the
        truth within half a period.
        """
        stamps = self.having("truth").stamp_ns
        after = np.clip(np.searchsorted(stamps, columns.stamp_ns), 0, len(stamps) - 1)
        before = np.maximum(after - 1, 0)
        nearer = np.abs(stamps[after] - columns.stamp_ns) <= np.abs(stamps[before] - columns.stamp_ns)
        rows = np.where(nearer, after, before)
        near = np.abs(stamps[rows] - columns.stamp_ns) <= 0.5e9 * self.period
        return np.flatnonzero(near), rows[near]


def read_flight(path: str | Path, remap: Mapping[str, str] | None = None) -> FlightLog:
    """The flight of a recording.

    Args:
        path: rosbag2 folder or `.mcap` file, Sunpoint's own or foreign.
        remap: new names of topics, as `BagReader` takes them.

    Raises:
        BagError: it cannot be read, holds a topic of another definition of its type, or none of the types that a
            flight is made of. Damaged messages are left out and noted.
    """
    from css_recording.bag_reader import BagReader  # a quarter of a second that studies without bags need not pay

    with BagReader(path, remap) as reader:
        mission, notes = None, []
        origin = reader.description.get(IMPORTED_FROM)
        text = reader.mission_text
        if text is not None:
            try:
                mission = mission_from_text(text, f"{path}: mission")
            except MissionError as error:
                notes.append(f"the recorded mission is not valid here: {error}")
        messages: dict[str, tuple[type, list[bytes]]] = {
            topic.name: (LOGGED_TYPES[topic.type], []) for topic, _ in reader.topics if topic.type in LOGGED_TYPES
        }
        told = {topic.name: kind for topic, _ in reader.topics for kind in TOLD_TYPES if topic.type == type_name(kind)}
        if not messages:
            raise BagError(f"{path}: holds no truth, estimate, cell output, wheel or control message")
        messages |= {name: (kind, []) for name, kind in told.items()}
        append = {topic: received.append for topic, (_, received) in messages.items()}
        for topic, _, _, data in reader.messages(messages):
            append[topic](data)
        notes += [*reader.notes, *map(str, reader.refused)]
    log = FlightLog(str(path), mission, notes=notes, imported=origin is not None)
    if origin is not None:
        log.known_truth = _known_truth(origin)
    for topic, (message_type, received) in messages.items():
        if topic not in told:
            log.add(topic, message_type, _whole(topic, codec_of(message_type), _came(received), notes).sorted())
    for topic, kind in sorted(told.items()):
        log.tell(topic, kind, _each_whole(topic, codec_of(kind), messages[topic][1], notes))
    return log


def _known_truth(origin: str) -> frozenset[str]:
    """What an import says that it knows; those that do not say knew the Sun, and the rate if it was there."""
    try:
        told = json.loads(origin)
    except ValueError:
        told = None
    parts = told.get("truth") if isinstance(told, dict) else None
    return frozenset(map(str, parts)) if isinstance(parts, list) else frozenset(("sun", "rate"))


def _names_on(topic: str, mission: Mission | None) -> Units:
    """Names of the units of the node that tells its faults on a topic, as far as the mission has it."""
    nodes = () if mission is None else mission.nodes
    return next((node.host.units for node in nodes if topic.startswith(f"/faults/{node.name}/")), {})


def _came(received: list[bytes]) -> list[bytes]:
    """Messages without those that say that there is none, and without second copies."""
    pairs = zip(received, [b"", *received], strict=False)
    return [data for data, before in pairs if data != before and not is_gap(data)]


def _whole(topic: str, codec: Codec, received: list[bytes], notes: list[str]) -> Columns:
    """Columns of the messages that are whole; others are left out and noted."""
    try:
        return stack(codec, received)
    except DecodeError as error:
        good = [data for data in received if _decodes(codec, data)]
        count = len(received) - len(good)
        notes.append(f"topic {topic}: {count} of {len(received)} messages left out: {error}")
        return stack(codec, good)


def _each_whole(topic: str, codec: Codec, received: list[bytes], notes: list[str]) -> list[Sample]:
    """The messages that are whole, of a type whose columns differ in length; others are noted."""
    good = [data for data in received if _decodes(codec, data)]
    if len(good) < len(received):
        notes.append(f"topic {topic}: {len(received) - len(good)} of {len(received)} messages left out")
    return [codec.decode(data) for data in good]


def _decodes(codec: Codec, data: bytes) -> bool:
    try:
        codec.decode(data)
    except DecodeError:
        return False
    return True
