# SPDX-License-Identifier: Apache-2.0
"""Mission sections that any mission may have, with the checks that one value alone cannot pass or fail.

They stand under `/**` in a mission file, like those that other packages bring (`css_common.shared_sections`). Defaults
are nobody's spacecraft: what no two have in common is empty until a mission says it, and components that need it ask
for it (`Component.needed`).
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from css_common.codec import MAX_FRAME
from css_common.earth import EARTH_RADIUS
from css_common.epochs import parse_utc
from css_common.link_kinds import LINK_FAULTS
from css_common.schema import Parameter, Table, Values, choice, flag, integer, real, reals, shown, text, texts
from css_common.section import Section, unit_rows

_LAST_STAMP_NS = 2**31 * 1_000_000_000
_NAME = re.compile(r"\w[\w !#$%&'()+,\-.;=@\[\]^`{}~]*")  # nothing that a file system takes for its own
_LONGEST_NAME = 100  # [bytes] with what is added to it a file name of 255 bytes
_MOST_STEPS = 10**9
_LOWEST = 100e3  # altitude [m] below which the atmosphere lets nothing orbit

EPOCH = text("mission.epoch", "", "UTC instant of the first step", example='mission: {epoch: "2026-06-01T00:00:00Z"}')
EPOCH_SPREAD = real(
    "mission.epoch_spread_days",
    0.0,
    "d",
    "cases begin at instants within so many days after the epoch, each at one of its own",
    low=0.0,
    high=20_000.0,
)
DURATION = real(
    "mission.duration",
    None,
    "s",
    "simulated time to fly",
    low=0.0,
    open_low=True,
    high=3.2e8,
    example="mission: {duration: 5550.0}",
)
PERIOD = real("mission.period", 0.1, "s", "control cycle", low=0.001, high=60.0)
SEED = integer("mission.seed", 1, "-", "key of all random streams", low=0, high=2**63 - 1)
CASE = integer("mission.case", 0, "-", "case number within the seed", low=0, high=2**32 - 1)

MISSION: Table = (
    text("mission.name", "unnamed", "name of the mission, as in the file name"),
    text("mission.description", "", "one line for reports"),
    EPOCH,
    EPOCH_SPREAD,
    DURATION,
    PERIOD,
    SEED,
    CASE,
)

ORBIT_SOURCE = choice(
    "orbit.source",
    "none",
    ("none", "elements", "tle", "ballistic"),
    "what defines the orbit",
    example="orbit: {source: elements, altitude: 400.0e+3, inclination_deg: 51.6}",
)
ALTITUDE = real("orbit.altitude", 0.0, "m", "semi-major axis above the equatorial radius", low=0.0, high=1e9)
ECCENTRICITY = real("orbit.eccentricity", 0.0, "-", "eccentricity", low=0.0, high=0.9)
LAUNCH_LATITUDE = real(
    "orbit.launch.latitude_deg",
    None,
    "deg",
    "geodetic latitude where a ballistic arc begins",
    low=-90.0,
    high=90.0,
    example="orbit: {launch: {latitude_deg: 69.29}}",
)
LAUNCH_LONGITUDE = real(
    "orbit.launch.longitude_deg",
    None,
    "deg",
    "its longitude, east",
    low=-180.0,
    high=360.0,
    example="orbit: {launch: {longitude_deg: 16.02}}",
)
LAUNCH_HEIGHT = real("orbit.launch.height", 0.0, "m", "its height above the ellipsoid", low=-500.0, high=100e3)
LAUNCH_AZIMUTH = real(
    "orbit.launch.azimuth_deg",
    None,
    "deg",
    "direction of the arc's start from north over east",
    low=-360.0,
    high=360.0,
    example="orbit: {launch: {azimuth_deg: 330.0}}",
)
LAUNCH_ELEVATION = real(
    "orbit.launch.elevation_deg",
    None,
    "deg",
    "its elevation",
    low=10.0,
    high=90.0,
    example="orbit: {launch: {elevation_deg: 80.0}}",
)
LAUNCH_APOGEE = real(
    "orbit.launch.apogee",
    None,
    "m",
    "height of its apogee above the ellipsoid",
    low=1e3,
    high=2000e3,
    example="orbit: {launch: {apogee: 169.0e+3}}",
)

LATER_ELEMENTS = reals(
    "orbit.later_elements",
    (),
    "-",
    "further elements of the integrated model, a row each: seconds after the epoch from which on they hold, then "
    "altitude [m], eccentricity, inclination, raan, argument of perigee and true anomaly [deg] at that instant",
    columns=7,
)

ORBIT: Table = (
    ORBIT_SOURCE,
    ALTITUDE,
    ECCENTRICITY,
    real("orbit.inclination_deg", 0.0, "deg", "to the mean equator J2000", low=0.0, high=180.0),
    real("orbit.raan_deg", 0.0, "deg", "right ascension of the ascending node", low=-360.0, high=360.0),
    real("orbit.argument_of_perigee_deg", 0.0, "deg", "argument of perigee", low=-360.0, high=360.0),
    real("orbit.true_anomaly_deg", 0.0, "deg", "true anomaly at the epoch", low=-360.0, high=360.0),
    choice(
        "orbit.model",
        "secular",
        ("secular", "j2_integrated"),
        "elements that stand still or drift evenly, or motion from them integrated under J2, short periods included",
    ),
    flag("orbit.j2", False, "secular drift of node, perigee and anomaly by J2, of the secular model"),
    LATER_ELEMENTS,
    text("orbit.tle_line1", "", "first line of the element set, when the source is tle"),
    text("orbit.tle_line2", "", "second line of the element set"),
    LAUNCH_LATITUDE,
    LAUNCH_LONGITUDE,
    LAUNCH_HEIGHT,
    LAUNCH_AZIMUTH,
    LAUNCH_ELEVATION,
    LAUNCH_APOGEE,
)

INERTIA = reals(
    "spacecraft.inertia",
    (),
    "kg m^2",
    "inertia matrix about the centre of mass, wheels included, row-major",
    length=9,
    columns=3,
    example="spacecraft: {inertia: [10.5, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 6.75]}",
)
ARRAY_NORMAL = reals("spacecraft.array_normal", (0.0, 0.0, 1.0), "-", "normal of the solar arrays in b", length=3)

SPACECRAFT: Table = (
    INERTIA,
    ARRAY_NORMAL,
)

WHEELS_FITTED = flag(
    "wheels.fitted", True, "the spacecraft carries reaction wheels; without them it flies uncontrolled"
)
WHEEL_AXES = reals(
    "wheels.axes",
    (),
    "-",
    "spin axes of the reaction wheels in b, one row of x, y, z each",
    columns=3,
    example="wheels: {axes: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}",
)
WHEEL_INERTIA = real(
    "wheels.inertia",
    None,
    "kg m^2",
    "spin inertia of each wheel",
    low=0.0,
    open_low=True,
    example="wheels: {inertia: 0.001}",
)
WHEEL_MAX_TORQUE = real(
    "wheels.max_torque", None, "N m", "torque limit of each wheel", low=0.0, example="wheels: {max_torque: 0.030}"
)
WHEEL_MAX_SPEED = real(
    "wheels.max_speed_rpm", None, "rpm", "speed limit of each wheel", low=0.0, example="wheels: {max_speed_rpm: 6000.0}"
)

WHEEL_INERTIAS = reals(
    "wheels.inertias", (), "kg m^2", "spin inertia of each wheel; empty: wheels.inertia for all", low=1e-12
)
WHEEL_MAX_TORQUES = reals(
    "wheels.max_torques", (), "N m", "torque limit of each wheel; empty: wheels.max_torque for all", low=0.0
)
WHEEL_MAX_SPEEDS = reals(
    "wheels.max_speeds_rpm",
    (),
    "rpm",
    "speed limit of each wheel (its largest momentum over its inertia); empty: wheels.max_speed_rpm for all",
    low=0.0,
)

WHEELS: Table = (
    WHEELS_FITTED,
    WHEEL_AXES,
    WHEEL_INERTIA,
    WHEEL_MAX_TORQUE,
    WHEEL_MAX_SPEED,
    WHEEL_INERTIAS,
    WHEEL_MAX_TORQUES,
    WHEEL_MAX_SPEEDS,
)
_EACH: dict[Parameter[float], Parameter[np.ndarray]] = {
    WHEEL_INERTIA: WHEEL_INERTIAS,
    WHEEL_MAX_TORQUE: WHEEL_MAX_TORQUES,
    WHEEL_MAX_SPEED: WHEEL_MAX_SPEEDS,
}

RODS_FITTED = flag("rods.fitted", False, "the spacecraft carries magnetic torque rods")
ROD_AXES = reals(
    "rods.axes", (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), "-", "rod axes in b, a row each", columns=3
)
ROD_MAX_DIPOLE = real("rods.max_dipole", 20.0, "A m^2", "dipole limit of each rod", low=0.0)
ROD_MAX_DIPOLES = reals(
    "rods.max_dipoles", (), "A m^2", "dipole limit of each rod; empty: rods.max_dipole for all", low=0.0
)

RODS: Table = (
    RODS_FITTED,
    ROD_AXES,
    ROD_MAX_DIPOLE,
    ROD_MAX_DIPOLES,
)

FIELD_DIVIDER = integer(
    "magnetometer.divider", 1, "steps", "a measurement is due every so many steps", low=1, high=100000
)

MEASURED_FIELD_BIAS = reals(
    "magnetometer.measured.bias_nt", (), "nT", "bias of the magnetometer, as calibrated; empty: none", columns=3
)
MEASURED_FIELD_MATRIX = reals(
    "magnetometer.measured.matrix",
    (),
    "-",
    "what the magnetometer makes of a field besides its bias, as calibrated, row-major; empty: the field itself",
    columns=3,
)
MEASURED_GYRO_BIAS = reals(
    "gyro.measured.bias_deg_h", (), "deg/h", "bias of the gyro, as calibrated; empty: none", columns=3
)

MAGNETOMETER: Table = (FIELD_DIVIDER, MEASURED_FIELD_BIAS, MEASURED_FIELD_MATRIX)
GYRO: Table = (MEASURED_GYRO_BIAS,)

MEASURES: Table = (
    real(
        "measures.settled_time", 0.0, "s", "from the epoch, after which an attitude filter counts as settled", low=0.0
    ),
    real(
        "measures.late_time",
        0.0,
        "s",
        "sunlit time at the end of a flight whose mean heading error studies state; 0: they do not",
        low=0.0,
    ),
    real(
        "measures.report_time",
        0.0,
        "s",
        "time from the epoch at which studies state the body rate and its error; 0: they do not",
        low=0.0,
    ),
    real(
        "measures.detumbled_rate_deg_s",
        0.0,
        "deg/s",
        "body rate below which a spacecraft counts as detumbled; 0: detumbling is not measured",
        low=0.0,
        high=360.0,
    ),
    real(
        "measures.required_share",
        0.0,
        "-",
        "share of the cases of a study that must meet the criteria; 0: criteria judge flights alone",
        low=0.0,
        high=1.0,
    ),
)

SAMPLING: Table = (
    choice(
        "sampling.method",
        "random",
        ("random", "lhs", "sobol", "saltelli"),
        "how dispersed parameters are drawn over the cases of a study",
    ),
    integer(
        "sampling.cases",
        0,
        "-",
        "cases that a Latin hypercube is spread over, or base points of a Saltelli design",
        low=0,
        high=2**24,
    ),
)

GRAPH: Table = (
    texts(
        "graph.nodes",
        (),
        "nodes of the graph as PACKAGE/EXECUTABLE, or PACKAGE/EXECUTABLE:NAME for a second one of a kind",
    ),
    text("graph.estimator", "ekf", "name of the Sun estimator that the control listens to"),
)

LOCKSTEP: Table = (
    texts("lockstep.wait_for", (), "topics that dynamics waits for; empty: commands and all estimates"),
    real("lockstep.realtime_factor", 0.0, "-", "pace against the wall clock; 0: as fast as it goes", low=0.0),
    real("lockstep.warn_after", 2.0, "s", "wall time of silence before the missing topic is named", low=0.05),
    real(
        "lockstep.hold_limit",
        30.0,
        "s",
        "wall time of silence before the flight goes on without the partner, actuators at rest",
        low=0.1,
    ),
    flag("lockstep.publish_clock", False, "also publish simulated time on /clock, for tools that follow it"),
    flag("lockstep.wait_for_recorder", False, "hold the flight when its recorder falls behind"),
    integer("lockstep.recorders", 0, "-", "recorders that must be listening before the first step", low=0, high=16),
    real("lockstep.startup_limit", 180.0, "s", "wall time allowed for all partners to appear", low=0.1),
)

IO: Table = (
    choice(
        "io.input_matching",
        "exact",
        ("exact", "latest"),
        "exact: inputs of one stamp belong together; latest: the newest of each, for devices with own clocks",
    ),
    real("io.deadline", 0.5, "s", "age at which an input counts as silent", low=0.001, high=1e9, tunable=True),
    text("io.body_frame", "bus", "frame_id of body-frame messages"),
    text("io.inertial_frame", "eci", "frame_id of inertial messages"),
    texts("io.accepted_frames", (), "further frame_ids taken for the expected one, as hardware drivers name them"),
    choice(
        "io.writers",
        "first",
        ("first", "graph"),
        "whose messages are taken: first: one writer a topic until it is gone, the mission's own before others; "
        "graph: only the node that the mission names for a topic",
    ),
    LINK_FAULTS,
    real("io.largest_gap", 60.0, "s", "a stamp further ahead than this must be confirmed", low=0.001, high=1e9),
    flag("autostart", True, "configure and activate without being asked"),
)


def name_for_files(text: str) -> str:
    """A text made a `mission.name`: what no name may hold becomes `_`, and what is too long is cut off."""
    kept = "".join(letter if letter == "_" or _NAME.fullmatch(f"_{letter}") else "_" for letter in text)
    if not _NAME.match(kept):
        kept = f"_{kept}"
    return kept.encode()[:_LONGEST_NAME].decode(errors="ignore")


def needed_of_orbit(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that has to know where the spacecraft is."""
    launch = (LAUNCH_LATITUDE, LAUNCH_LONGITUDE, LAUNCH_AZIMUTH, LAUNCH_ELEVATION, LAUNCH_APOGEE)
    of_source = launch if values[ORBIT_SOURCE] == "ballistic" else ()
    return tuple(p.name for p in (ORBIT_SOURCE, EPOCH, *of_source))


def needed_of_wheels(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that turns the wheels, if there are any."""
    if not values[WHEELS_FITTED]:
        return ()
    return (WHEEL_AXES.name, *(of_all.name for of_all, each in _EACH.items() if not len(values[each])))


def needed_of_wheel_momentum(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that counts the momentum of the wheels that there are."""
    return (WHEEL_INERTIA.name,) if len(wheel_axes(values)) and not len(values[WHEEL_INERTIAS]) else ()


def wheel_axes(values: Values) -> np.ndarray:
    """Spin axes (N, 3) of the reaction wheels that the spacecraft carries, in b; none without wheels."""
    return values[WHEEL_AXES] if values[WHEELS_FITTED] else np.zeros((0, 3))


def of_each_wheel(values: Values, of_all: Parameter[float]) -> np.ndarray:
    """Inertia [kg m^2], largest torque [N m] or speed [rpm] of each wheel (N,); NaN where nobody has said.

    Args:
        of_all: WHEEL_INERTIA, WHEEL_MAX_TORQUE or WHEEL_MAX_SPEED.
    """
    each = values[_EACH[of_all]]
    return np.array(each) if len(each) else np.full(len(values[WHEEL_AXES]), values[of_all])


def rod_max_dipoles(values: Values) -> np.ndarray:
    """Largest dipole (M,) of each rod [A m^2]."""
    each = values[ROD_MAX_DIPOLES]
    return np.array(each) if len(each) else np.full(len(values[ROD_AXES]), values[ROD_MAX_DIPOLE])


def _wheels_conflicts(wheels: Values) -> Iterator[str]:
    if not len(wheels.axes):
        return
    yield from unit_rows("wheels.axes", wheels.axes, 3, 32)
    for key in ("inertias", "max_torques", "max_speeds_rpm"):
        if len(getattr(wheels, key)) not in (0, len(wheels.axes)):
            yield f"wheels.{key}: {len(getattr(wheels, key))} given, expected one for each of {len(wheels.axes)} wheels"
    rank = np.linalg.matrix_rank(wheels.axes) if wheels.axes.size else 0
    if rank < 3:
        yield f"wheels.axes: they span {rank} of 3 directions, expected axes that span all"


def _rods_conflicts(rods: Values) -> Iterator[str]:
    yield from unit_rows("rods.axes", rods.axes, 1, 32)
    if len(rods.max_dipoles) not in (0, len(rods.axes)):
        yield f"rods.max_dipoles: {len(rods.max_dipoles)} given, expected one for each of {len(rods.axes)} rods"


def _magnetometer_conflicts(magnetometer: Values) -> Iterator[str]:
    measured = magnetometer.measured
    if len(measured.bias_nt) not in (0, 1):
        yield f"magnetometer.measured.bias_nt: {3 * len(measured.bias_nt)} numbers given, expected three or none"
    if not len(measured.matrix):
        return
    if len(measured.matrix) != 3:
        yield f"magnetometer.measured.matrix: {3 * len(measured.matrix)} numbers given, expected nine or none"
    elif abs(np.linalg.det(measured.matrix)) < 1e-3:
        yield "magnetometer.measured.matrix: singular, expected one near the identity"


def _gyro_conflicts(gyro: Values) -> Iterator[str]:
    if len(gyro.measured.bias_deg_h) not in (0, 1):
        yield f"gyro.measured.bias_deg_h: {3 * len(gyro.measured.bias_deg_h)} numbers given, expected three or none"


def _io_conflicts(io: Values) -> Iterator[str]:
    for key in ("body_frame", "inertial_frame"):
        if len(getattr(io, key).encode()) >= MAX_FRAME:
            yield f"io.{key}: expected a name shorter than {MAX_FRAME} bytes"


def _mission_conflicts(mission: Values) -> Iterator[str]:
    if not _NAME.fullmatch(mission.name) or len(mission.name.encode()) > _LONGEST_NAME:
        yield (
            f"mission.name: {shown(mission.name)} given, expected a name for files of at most {_LONGEST_NAME} bytes: "
            "letters, digits, spaces and _-+.,=() and the like, the first a letter or digit"
        )
    duration = 0.0 if math.isnan(mission.duration) else mission.duration
    steps = duration / mission.period
    if duration and not 1.0 - 1e-6 <= steps <= _MOST_STEPS:
        yield (
            f"mission.duration: {mission.duration:g} s given, {steps:.3g} steps of mission.period {mission.period:g} s,"
            f" expected 1 to {_MOST_STEPS}"
        )
    if not mission.epoch:
        return
    try:
        begin = parse_utc(mission.epoch)
    except ValueError as error:
        yield f"mission.epoch: {error}"
        return
    spread_s = mission.epoch_spread_days * 86_400.0
    if begin < 0 or begin + (spread_s + duration) * 1e9 >= _LAST_STAMP_NS:
        yield (
            f"mission.epoch: {mission.epoch} given, expected {f'a flight of {duration:g} s' if duration else 'one'} "
            "between 1970-01-01 and 2038-01-19: the seconds of a ROS stamp have 32 bits"
        )


def _orbit_conflicts(orbit: Values) -> Iterator[str]:
    if orbit.source == "tle":
        for key in ("tle_line1", "tle_line2"):
            if len(getattr(orbit, key)) != 69:
                yield f"orbit.{key}: expected the 69 characters of a two-line element set"
    if orbit.model == "j2_integrated" and orbit.source in ("tle", "ballistic"):
        yield f"orbit.model: j2_integrated given with orbit.source {orbit.source}, expected elements as the source"
    if len(orbit.later_elements) and (orbit.source != "elements" or orbit.model != "j2_integrated"):
        yield "orbit.later_elements: given, expected elements as orbit.source and j2_integrated as orbit.model"
    if orbit.source != "elements":
        return
    yield from _later_conflicts(orbit.later_elements)
    if orbit.altitude < _LOWEST:
        given = f"{orbit.altitude:g} given" if orbit.altitude else "missing"
        yield f"orbit.altitude: {given}, expected a number [m], at least {_LOWEST:g}, for instance 400.0e+3"
        return
    axis = EARTH_RADIUS + orbit.altitude
    perigee = axis * (1.0 - orbit.eccentricity) - EARTH_RADIUS
    if perigee < _LOWEST - 1e-3:
        most = math.floor((orbit.altitude - _LOWEST) / axis * 1e4) * 1e-4
        yield (
            f"orbit.eccentricity: {orbit.eccentricity:g} given, which with orbit.altitude {orbit.altitude:g} m puts "
            f"the perigee at {perigee / 1e3:.0f} km; expected at most {most:.4f}, a perigee of {_LOWEST / 1e3:g} km"
        )


def _later_conflicts(rows: np.ndarray) -> Iterator[str]:
    """What is wrong with further elements (N, 7)."""
    for number, (start, altitude, eccentricity, inclination, *angles) in enumerate(rows.tolist()):
        before = rows[number - 1, 0] if number else 0.0
        wrong = ""
        if not start > before:
            wrong = f"holds from {start:g} s on, expected a time after {before:g} s"
        elif not (0.0 <= eccentricity <= 0.9 and 0.0 <= inclination <= 180.0 and all(abs(a) <= 360.0 for a in angles)):
            wrong = "expected an eccentricity of 0 to 0.9, an inclination of 0 to 180 deg, angles of -360 to 360 deg"
        elif not _LOWEST - 1e-3 <= (EARTH_RADIUS + altitude) * (1.0 - eccentricity) - EARTH_RADIUS <= 1e9:
            wrong = f"altitude {altitude:g} m, expected a perigee of at least {_LOWEST / 1e3:g} km"
        if wrong:
            yield f"orbit.later_elements: row {number}: {wrong}"
            return


def _spacecraft_conflicts(spacecraft: Values) -> Iterator[str]:
    if len(spacecraft.inertia):
        yield from _inertia_conflicts(spacecraft.inertia)
    length = np.linalg.norm(spacecraft.array_normal)
    if abs(length - 1.0) > 1e-6:
        yield f"spacecraft.array_normal: length {length:.6g} given, expected a unit vector"


def _inertia_conflicts(inertia: np.ndarray) -> Iterator[str]:
    if not np.allclose(inertia, inertia.T, rtol=1e-12, atol=0.0):
        yield "spacecraft.inertia: not symmetric, expected a symmetric positive definite matrix"
        return
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 0.0:
        yield f"spacecraft.inertia: eigenvalue {moments[0]:.6g} given, expected a positive definite matrix"
    elif moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        yield (
            f"spacecraft.inertia: principal moments {', '.join(f'{m:.6g}' for m in moments)} break the triangle "
            "inequality, no rigid body has them"
        )


SECTIONS: dict[str, Section] = {
    "mission": Section(MISSION, _mission_conflicts),
    "orbit": Section(ORBIT, _orbit_conflicts),
    "spacecraft": Section(SPACECRAFT, _spacecraft_conflicts),
    "wheels": Section(WHEELS, _wheels_conflicts),
    "rods": Section(RODS, _rods_conflicts),
    "magnetometer": Section(MAGNETOMETER, _magnetometer_conflicts),
    "gyro": Section(GYRO, _gyro_conflicts),
    "measures": Section(MEASURES),
    "sampling": Section(SAMPLING),
    "graph": Section(GRAPH),
    "lockstep": Section(LOCKSTEP),
    "io": Section(IO, _io_conflicts),
}
