# SPDX-License-Identifier: Apache-2.0
"""What a recording tells of cells, rates, field, place and Sun, as arrays over the instants of the cell outputs.

An instant is the stamp of a message of cell outputs. Rates and field belong to an instant when they are no further from
it than half of its period; else they are missing there (NaN), and nothing is made up. A truth without a place (zeros,
as imported telemetry has it) knows the Sun in the body alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from sensor_msgs.msg import Imu, MagneticField, Temperature

from css_analysis.flight_log import to_body
from css_calibration.errors import CalibrationError
from css_common.attitude import mrp_to_dcm
from css_common.codec import DecodeError, codec_of, type_name
from css_common.kernel import kernel
from css_common.link import is_gap
from css_common.message_columns import Columns, columns_of, stack
from css_common.mission import Mission, MissionError, mission_from_text
from css_common.vectors import row
from css_environment.mission_environment import mission_orbit
from css_environment.orbit import orbit_states
from css_environment.orbit_checks import recorded_orbit_findings
from css_msgs.msg import CssVoltages, SpacecraftState
from css_recording.bag_reader import BagReader

# Messages that are taken, and the topic that Sunpoint gives them; of several of a type that one, else the first.
_TAKEN = {
    type_name(CssVoltages): (CssVoltages, "/css/voltages"),
    type_name(Imu): (Imu, "/gyro/imu"),
    type_name(MagneticField): (MagneticField, "/mag/field"),
    type_name(SpacecraftState): (SpacecraftState, "/truth"),
    type_name(Temperature): (Temperature, "/css/temperature"),
}
_FEWEST = 20  # instants
_SURELY_LIT, _NOTHING, _MOST_DARK = 0.6, 0.1, 0.7


@dataclass
class Recorded:
    """One recording.

    Attributes:
        origin: where it comes from, for messages.
        mission: whose cells they are.
        stamp_ns: (M,) instants.
        voltages: (M, N) outputs of the cells [-], NaN where missing.
        saturated: (M, N) whether an output is at the limit of its converter.
        gyro_ns: (G,) stamps of the rates.
        gyro_b: (G, 3) measured body rates [rad/s].
        field_b: (M, 3) measured magnetic field [T], NaN where there is none; None: no magnetometer.
        temperature: (M,) [deg C] of the cells; None: not recorded.
        sun_b: (M, 3) true direction to the Sun in b, NaN where unknown; None: not recorded.
        dcm_bn: (M, 3, 3) true attitude, of a truth that knows its place; None: unknown.
        r_n: (M, 3) position [m]; None: unknown.
        sunlight: (M,) intensity of the Sun that a truth without a place tells; None: unknown.
        notes: what was left out or guessed, one line each.
        no_place: why the orbit of the mission tells no position; empty: it does, or there is none.
    """

    origin: str
    mission: Mission
    stamp_ns: np.ndarray
    voltages: np.ndarray
    saturated: np.ndarray
    gyro_ns: np.ndarray
    gyro_b: np.ndarray
    field_b: np.ndarray | None = None
    temperature: np.ndarray | None = None
    sun_b: np.ndarray | None = None
    dcm_bn: np.ndarray | None = None
    r_n: np.ndarray | None = None
    sunlight: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)
    no_place: str = ""

    @property
    def period_s(self) -> float:
        """Usual step of the instants [s]."""
        return float(np.median(np.diff(self.stamp_ns))) * 1e-9

    @property
    def time(self) -> np.ndarray:
        """(M,) [s] since the first instant."""
        return (self.stamp_ns - self.stamp_ns[0]) * 1e-9

    def at(self, rows: np.ndarray) -> "Recorded":
        """The same at some of the instants; rates stay whole, for they are integrated."""

        def some(values: np.ndarray | None) -> np.ndarray | None:
            return None if values is None else values[rows]

        return Recorded(
            self.origin,
            self.mission,
            self.stamp_ns[rows],
            self.voltages[rows],
            self.saturated[rows],
            self.gyro_ns,
            self.gyro_b,
            some(self.field_b),
            some(self.temperature),
            some(self.sun_b),
            some(self.dcm_bn),
            some(self.r_n),
            some(self.sunlight),
            self.notes,
            self.no_place,
        )


def read_recorded(path: str | Path, mission: Mission | None = None, remap: Mapping[str, str] | None = None) -> Recorded:
    """What a recording holds.

    Args:
        path: rosbag2 folder or file.
        mission: whose cells and orbit these are; None: the recording's own says it.
        remap: new names of topics.

    Raises:
        BagError: it cannot be read.
        MissionError: its mission is wrong.
        CalibrationError: it holds no cell outputs, or no mission although none is given.
    """
    with BagReader(path, remap) as reader:
        text = reader.mission_text
        notes: list[str] = []
        if mission is None and text is None:
            raise CalibrationError(f"{path}: holds no mission; whose cells are these? --mission NAME says it")
        if mission is None:
            assert text is not None
            mission = mission_from_text(text, f"{path}: embedded mission")
        topics = _topics(reader, notes)
        received: dict[str, list[bytes]] = {name: [] for name in topics}
        for message in reader.messages(list(topics)) if topics else ():
            if not is_gap(message.data):
                received[message.topic].append(message.data)
        notes += [*reader.notes, *map(str, reader.refused)]
    columns = {topics[name]: _whole(name, topics[name], data, notes) for name, data in received.items() if data}
    return recorded_of(str(path), mission, columns, notes)


def _topics(reader: BagReader, notes: list[str]) -> dict[str, type]:
    """Topics to read, each with its message class."""
    chosen: dict[str, str] = {}
    for topic, _ in reader.topics:
        if topic.type not in _TAKEN:
            continue
        usual = _TAKEN[topic.type][1]
        if topic.type not in chosen or topic.name == usual:
            if topic.type in chosen:
                notes.append(f"of several topics of {topic.type} {usual} is taken")
            chosen[topic.type] = topic.name
    return {name: _TAKEN[kind][0] for kind, name in chosen.items()}


def _whole(topic: str, kind: type, received: list[bytes], notes: list[str]) -> Columns:
    """Columns of the messages that are whole; others are counted."""
    codec = codec_of(kind)
    try:
        return stack(codec, received).sorted()
    except DecodeError as error:
        samples = []
        for data in received:
            try:
                samples.append(codec.decode(data))
            except DecodeError:
                continue
        notes.append(f"{topic}: {len(received) - len(samples)} of {len(received)} messages left out: {error}")
        return columns_of(codec, samples).sorted()


def recorded_of(origin: str, mission: Mission, columns: Mapping[type, Columns], notes: list[str]) -> Recorded:
    """What columns of messages, by their class, tell.

    Raises:
        CalibrationError: there are too few cell outputs, or of another number of cells than the mission's.
    """
    cells = columns.get(CssVoltages)
    count = len(mission.values.cells.normals)
    if not count:
        raise CalibrationError(f"{mission.origin}: cells.normals: missing, expected the normals of the cells")
    if cells is None or len(cells) < _FEWEST:
        found = 0 if cells is None else len(cells)
        raise CalibrationError(f"{origin}: {found} messages of cell outputs (css_msgs/CssVoltages), expected {_FEWEST}")
    if cells.voltages.shape[1] != count:
        raise CalibrationError(
            f"{origin}: messages have {cells.voltages.shape[1]} cell outputs, the mission has {count} cells; expected "
            "as many"
        )
    stamps, section = cells.stamp_ns, mission.values.cells
    voltages = np.array(cells.voltages, dtype=np.float64)
    outside = ~((voltages >= section.smallest_reading) & (voltages <= section.largest_reading))
    if outside.any():
        notes.append(f"{int(outside.sum())} cell outputs are no readings and count as missing")
    voltages[outside] = np.nan
    gyro_ns, gyro_b = _rates(columns.get(Imu))
    bits = np.asarray(cells.saturated, dtype=np.int64)[:, None] >> np.arange(count)[None, :] & 1
    recorded = Recorded(origin, mission, stamps, voltages, bits.astype(bool), gyro_ns, gyro_b, notes=notes)
    half_ns = 500_000_000 * recorded.period_s
    recorded.field_b = _field(columns.get(MagneticField), stamps, half_ns)
    recorded.temperature = _temperature(columns.get(Temperature), stamps)
    truth = columns.get(SpacecraftState)
    if truth is not None and len(truth):
        _add_truth(recorded, truth, half_ns)
    if recorded.r_n is None and mission.values.orbit.source != "none" and mission.values.mission.epoch:
        _add_place(recorded)
    return recorded


def _add_place(recorded: Recorded) -> None:
    """Positions by the orbit of the mission; none where its element set is of another time."""
    mission, stamps = recorded.mission, recorded.stamp_ns
    for finding in recorded_orbit_findings(mission.values, int(stamps[0]), int(stamps[-1])):
        recorded.notes.append(finding.text)
        if finding.refused:
            recorded.no_place = finding.text
            return
    elapsed = (stamps - mission.epoch_ns) * 1e-9
    try:
        recorded.r_n, _ = orbit_states(mission_orbit(mission.values), mission.epoch_ns, elapsed)
    except ValueError as error:
        raise MissionError(f"{mission.origin}: orbit: {error}") from error


def _rates(imu: Columns | None) -> tuple[np.ndarray, np.ndarray]:
    if imu is None or not len(imu):
        return np.zeros(0, np.int64), np.zeros((0, 3))
    rates = np.asarray(imu.angular_velocity, dtype=np.float64)
    good = (np.asarray(imu.angular_velocity_covariance)[:, 0] != -1.0) & np.isfinite(rates).all(axis=1)
    return imu.stamp_ns[good], rates[good]


def _nearest(wanted: np.ndarray, stamps: np.ndarray, within_ns: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of `stamps` nearest to the wanted ones, and which of them are near enough."""
    after = np.clip(np.searchsorted(stamps, wanted), 0, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(stamps[after] - wanted) <= np.abs(stamps[before] - wanted)
    rows = np.where(nearer, after, before)
    return rows, np.abs(stamps[rows] - wanted) <= within_ns


def _field(messages: Columns | None, stamps: np.ndarray, half_ns: float) -> np.ndarray | None:
    if messages is None or not len(messages):
        return None
    measured = np.array(messages.magnetic_field, dtype=np.float64)
    measured[np.asarray(messages.magnetic_field_covariance)[:, 0] == -1.0] = np.nan
    rows, near = _nearest(stamps, messages.stamp_ns, half_ns)
    return np.where(near[:, None], measured[rows], np.nan)


def _temperature(messages: Columns | None, stamps: np.ndarray) -> np.ndarray | None:
    """Between its messages a temperature changes evenly; before the first and after the last it stays."""
    if messages is None or not len(messages):
        return None
    values = np.asarray(messages.temperature, dtype=np.float64)
    good = np.isfinite(values)
    if not good.any():
        return None
    first = stamps[0]
    return np.interp((stamps - first) * 1e-9, (messages.stamp_ns[good] - first) * 1e-9, values[good])


def _add_truth(recorded: Recorded, truth: Columns, half_ns: float) -> None:
    rows, near = _nearest(recorded.stamp_ns, truth.stamp_ns, half_ns)
    length = np.linalg.norm(truth.sun_n[rows], axis=1)
    known = near & (np.abs(length - 1.0) < 1e-3)
    if not known.any():
        return
    sigma_bn = np.ascontiguousarray(truth.sigma_bn[rows])
    sun_b = to_body(sigma_bn, np.ascontiguousarray(truth.sun_n[rows]))
    sun_b[~known] = np.nan
    recorded.sun_b = sun_b
    placed = np.linalg.norm(truth.r_n[rows], axis=1) > 1e6
    if not placed[known].all():
        recorded.sunlight = np.where(known, truth.illumination[rows] * truth.solar_flux[rows], 1.0)
        _leave_dark_ones_out(recorded)
        return
    dcm_bn = np.empty((len(rows), 3, 3))
    _attitudes(sigma_bn, dcm_bn)
    dcm_bn[~known] = np.nan
    recorded.dcm_bn = dcm_bn
    r_n = np.array(truth.r_n[rows], dtype=np.float64)
    r_n[~known] = np.nan
    recorded.r_n = r_n


def _leave_dark_ones_out(recorded: Recorded) -> None:
    """Of a truth that knows no shadow: instants at which no cell reads anything that the Sun should shine on."""
    assert recorded.sun_b is not None and recorded.sunlight is not None
    section = recorded.mission.values.cells
    cosine = np.nan_to_num(recorded.sun_b) @ np.asarray(section.normals, dtype=np.float64).T
    lit = (cosine > _SURELY_LIT) & np.isfinite(recorded.voltages) & (recorded.sunlight > 0.5)[:, None]
    brightest = np.where(lit, recorded.voltages, -np.inf).max(axis=1)
    dark = lit.any(axis=1) & (brightest < _NOTHING)
    if dark.any() and dark.sum() < _MOST_DARK * len(dark):
        recorded.sun_b[dark] = np.nan
        recorded.notes.append(
            f"{int(dark.sum())} instants left out: no cell that the Sun should shine on reads anything, as in a shadow"
        )


@kernel
def _attitudes(sigma_bn, dcm_out) -> None:
    for k in range(sigma_bn.shape[0]):
        dcm = mrp_to_dcm(row(sigma_bn, k))
        for i in range(3):
            for j in range(3):
                dcm_out[k, i, j] = dcm[i][j]
