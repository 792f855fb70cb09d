# SPDX-License-Identifier: Apache-2.0
"""What the Sun filter knows of its spacecraft, and what it takes its errors to be."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import WHEEL_INERTIA, of_each_wheel
from css_common.conversions import square
from css_common.declared import computed, given, made, merged, part, table_of
from css_common.matrices import IDENTITY, inverse
from css_common.schema import Values, choice, flag, real, reals
from css_common.vectors import Mat3, mat3
from css_environment.albedo import Screen, plane_screen, with_views
from css_estimation.sun import flight_sky
from css_estimation.sun.cell_layout import CellLayout, cell_layout
from css_estimation.sun.eclipse_detector import EclipseParameters
from css_estimation.sun.flight_sky import USE_FIELD
from css_estimation.sun.lit_cells import Gate, gate_of_views
from css_estimation.sun.sun_tracking import GYRO_LIMIT, RATE_CUTOFF, USE_GYRO
from css_estimation.sun_filter import calibration_options
from css_estimation.sun_filter.calibration_options import Calibration, lasting_error
from css_sensors.cells import (
    MEASURED_DARKS,
    MEASURED_NORMALS,
    MEASURED_SCALES,
    blocked_directions,
    half_view_cosine,
    known_normals,
    own_view_cosines,
    plane_sides,
)
from css_sensors.corrections import corrections, of_output

CELL = np.dtype([(name, np.float64) for name in ("nx", "ny", "nz", "side", "gain", "dark", "low")], align=True)
"""One cell as calibrated: unit normal in b, side of the body plane that hides half of its sky (0: none), gain,
output in the dark and lowest output [-]."""

WHEEL = np.dtype([(name, np.float64) for name in ("hx", "hy", "hz")], align=True)
"""One reaction wheel: spin axis times spin inertia [kg m2]."""

_NO_NORMAL = 1e-9
_END_OF_NOISE = 0.6  # of its deviation; the mean of its upper half alone is 0.4
_FEWEST = 2  # points of a table

GAINS = reals("calibration.gains", (), "-", "output of each cell relative to the nominal; empty: all 1")
DARKS = reals("calibration.darks", (), "-", "output of each cell in the dark; empty: all 0")
NORMALS = reals("calibration.normals", (), "-", "measured normals of the cells, empty: those of the layout", columns=3)

_CURVES = {"cosine": 0, "okeefe": 1, "table": 2}
CURVE = choice(
    "response.curve", "cosine", tuple(_CURVES), "output over light: proportional, O'Keefe & Schaub's Eq. 16, a table"
)
TABLE = reals("response.table", (), "-", "outputs at light 0, ..., 1 in equal steps, for the curve `table`")

MINIMUM_OUTPUT = real("minimum_output", 0.3, "-", "no Sun unless a cell is above it", low=0.01, high=1.0)

USE_WHEELS = flag("use_wheels", True, "without gyro, take the rate from angular momentum and wheel speeds")


NOISE = real("noise", 0.006, "-", "white noise of a cell, 1 sigma", low=1e-6, high=1.0)
OUTPUT_LOW = real(
    "output_low",
    -10.0,
    "-",
    "lowest output that the cells' converter gives, whose noise ends there; far below 0: nothing ends",
    low=-10.0,
    high=1.0,
)


def _cells(values: Values) -> np.ndarray:
    """(N,) of CELL."""
    nominal = known_normals(values)
    cells = np.zeros(len(nominal), CELL)
    measured = np.asarray(values[NORMALS], dtype=np.float64).reshape(-1, 3) if len(values[NORMALS]) else nominal
    cells["nx"], cells["ny"], cells["nz"] = (measured / np.linalg.norm(measured, axis=1, keepdims=True)).T
    # what hides the sky is structure: it follows the layout, not a cell's tilt
    cells["side"] = plane_sides(values)
    cells["gain"] = values[GAINS] if len(values[GAINS]) else 1.0
    cells["dark"] = values[DARKS] if len(values[DARKS]) else 0.0
    cells["low"] = lowest = values[OUTPUT_LOW]
    taken_off = corrections(values)
    if taken_off.of_cells:
        # Outputs come with the mission's calibration taken off, and their lowest with them. A dark level that is no
        # more than the noise of a dark cell above the end of the converter is put back: here that noise is known.
        darks, scales = taken_off.darks, taken_off.scales
        of_noise = abs(darks - lowest) < _END_OF_NOISE * values[NOISE]
        cells["low"] = of_output(lowest, darks, scales)
        cells["dark"] += np.where(of_noise, of_output(0.0, darks, scales), 0.0)
    return cells


def _layout(values: Values) -> CellLayout:
    """The same cells, with the normals that were measured."""
    layout, cells = cell_layout(values), _cells(values)
    for name in ("nx", "ny", "nz"):
        layout.cells[name] = cells[name]
    return layout


def _gate(values: Values) -> Gate:
    return gate_of_views(values[MINIMUM_OUTPUT], values)


def _screen(values: Values) -> Screen:
    return with_views(plane_screen(values.cells.clip_normal), own_view_cosines(values), blocked_directions(values))


def _table(values: Values) -> np.ndarray:
    return np.asarray(values[TABLE], dtype=np.float64)


def _wheels(values: Values) -> np.ndarray:
    axes = np.asarray(values.wheels.axes, dtype=np.float64).reshape(-1, 3)
    wheels = np.zeros(len(axes), WHEEL)
    wheels["hx"], wheels["hy"], wheels["hz"] = of_each_wheel(values, WHEEL_INERTIA) * axes.T
    return wheels


def _has_wheels(values: Values) -> bool:
    return bool(values.wheels.fitted and len(values.wheels.axes))


def _knows_momentum(values: Values) -> bool:
    return bool(values[USE_WHEELS] and len(values.spacecraft.inertia))


def _inertia(values: Values) -> Mat3:
    """With the wheels' spin inertia along their axes, which the section leaves out; the identity when it is unknown."""
    if not len(values.spacecraft.inertia):
        return IDENTITY
    axes = np.asarray(values.wheels.axes, dtype=np.float64).reshape(-1, 3)
    body = np.asarray(values.spacecraft.inertia, dtype=np.float64).reshape(3, 3)
    if not values.wheels.fitted:
        return mat3(body)
    return mat3(body + np.einsum("n,ni,nj->ij", of_each_wheel(values, WHEEL_INERTIA), axes, axes))


def _anisotropy(values: Values) -> float:
    moments = np.linalg.eigvalsh(np.array(_inertia(values)))
    return float(moments[-1] - moments[0])


def _inverse_inertia(values: Values) -> Mat3:
    return inverse(_inertia(values))


class Response(NamedTuple):
    """Output of a cell over the light that it receives."""

    curve: int = made(_CURVES.__getitem__, CURVE)
    table: np.ndarray = computed(_table, TABLE)
    scale: float = given(
        real("response.scale", 1.0, "-", "mean output of all cells at full light", low=0.01, high=10.0)
    )


class CellErrors(NamedTuple):
    """Variances of what the model of the cells leaves out."""

    noise: float = made(square, NOISE)
    common: float = made(
        square,
        real("common_noise", 0.005, "-", "white error of the output common to all cells, 1 sigma", low=0.0, high=1.0),
    )
    scale: float = made(
        square,
        real("scale_sigma", 0.02, "-", "slow error of the output common to all cells, 1 sigma", low=0.0, high=1.0),
    )
    scale_time: float = given(real("scale_time", 3000.0, "s", "correlation time of it", low=1.0, high=1e9))
    cell: float = computed(
        lasting_error,
        calibration_options.MODE,
        calibration_options.GAIN_SIGMA,
        calibration_options.TILT_SIGMA,
        calibration_options.RESIDUAL,
    )
    cell_time: float = given(
        real(
            "tilt_time",
            600.0,
            "s",
            "time in which the Sun moves so far over a cell that its tilt makes another error",
            low=1.0,
            high=1e9,
        )
    )


UNKNOWN_HEADING = real(
    "albedo.unknown_heading_deg",
    1.5,
    "deg",
    "error of the Sun's height over a cell with a view of 120 deg by lasting light of an Earth that is not predicted; "
    "three times that with one of 180 deg",
    low=0.0,
    high=45.0,
)


def _unknown_heading(values: Values) -> float:
    """What the lasting light of an unknown Earth does, squared [rad2]: more on cells that see more of it.

    Flights of box and pyramids with cones of 120, 150 and 180 deg about the normals have errors of that size.
    """
    wide = min(max(3.0 - 4.0 * half_view_cosine(values), 1.0), 3.0)
    return (wide * math.radians(values[UNKNOWN_HEADING])) ** 2


class EarthErrors(NamedTuple):
    """How the real Earth differs from the mean one."""

    scale: float = made(
        square,
        real("albedo.scale_sigma", 0.5, "-", "error of all reflectivities in common, 1 sigma", low=0.0, high=10.0),
    )
    scale_time: float = given(real("albedo.scale_time", 2000.0, "s", "correlation time of it", low=1.0, high=1e9))
    clouds: float = given(
        real("albedo.cloud_sigma", 0.3, "-", "error of the light on a single cell, 1 sigma of it", low=0.0, high=10.0)
    )
    clouds_time: float = given(real("albedo.cloud_time", 70.0, "s", "correlation time of it", low=1.0, high=1e9))
    clouds_angle: float = made(  # [rad]
        math.radians,
        real(
            "albedo.cloud_angle_deg",
            50.0,
            "deg",
            "turn of the body after which a cell looks at other clouds",
            low=1.0,
            high=1e6,
        ),
    )
    unknown: float = given(
        real("albedo.unknown", 0.1, "-", "light of an Earth that is not predicted, on one cell", low=0.0, high=1.0)
    )
    largest: float = given(
        real(
            "albedo.largest", 0.3, "-", "light beyond the predicted that no Earth throws on a cell", low=0.01, high=2.0
        )
    )
    unknown_heading: float = computed(_unknown_heading, UNKNOWN_HEADING)  # [rad2]


class Motion(NamedTuple):
    """How the body turns, without gyro and with one."""

    inertia: Mat3 = computed(_inertia)  # [kg m2]
    inverse_inertia: Mat3 = computed(_inverse_inertia)
    anisotropy: float = computed(_anisotropy)  # [kg m2] largest less smallest principal moment
    wheels: np.ndarray = computed(_wheels)  # (N,) of WHEEL
    has_wheels: bool = computed(_has_wheels)
    knows_momentum: bool = computed(_knows_momentum, USE_WHEELS)
    use_gyro: bool = given(USE_GYRO)
    gyro_limit: float = made(math.radians, GYRO_LIMIT)
    cutoff: float = given(RATE_CUTOFF)
    gyro_noise: float = made(  # [rad2/s2]
        lambda rate: math.radians(rate) ** 2,
        real("gyro.noise_deg_s", 0.01, "deg/s", "white noise of a gyro sample, 1 sigma", low=0.0, high=10.0),
    )
    gyro_bias: float = made(  # [rad2/s2]
        lambda rate: math.radians(rate / 3600.0) ** 2,
        real("gyro.bias_deg_h", 1.0, "deg/h", "bias of the gyro, 1 sigma", low=0.0, high=1e5),
    )
    start_rate: float = made(  # [rad2/s2]
        lambda rate: math.radians(rate) ** 2,
        real("rate.start_deg_s", 2.0, "deg/s", "rate of a body that nothing is known of, 1 sigma", low=0.0, high=100.0),
    )
    gravity_gradient: bool = given(
        flag("rate.gravity_gradient", False, "reckon with the torque of gravity, once the attitude is known")
    )
    torque: float = made(  # [(N m)2 s]
        lambda torque, time: torque * torque * time,
        real("rate.torque", 1e-6, "N m", "unknown torque on the body, 1 sigma", low=0.0, high=100.0),
        real("rate.torque_time", 2000.0, "s", "correlation time of it", low=0.0, high=1e9),
    )
    acceleration: float = made(  # [rad2/s3]
        lambda rate: math.radians(rate) ** 2,
        real(
            "rate.walk_deg_s",
            0.1,
            "deg/s",
            "change of the rate within a second where neither gyro nor momentum tells it, 1 sigma",
            low=0.0,
            high=100.0,
        ),
    )


class Field(NamedTuple):
    """Of the magnetic field as a measurement."""

    use_field: bool = given(USE_FIELD)
    noise: float = made(  # [T2]
        lambda sigma: (1e-9 * sigma) ** 2,
        real("field.noise_nt", 100.0, "nT", "white noise of the magnetometer per axis, 1 sigma", low=0.0, high=1e5),
    )
    lasting: float = made(  # [T2]
        lambda sigma: (1e-9 * sigma) ** 2,
        real(
            "field.error_nt",
            300.0,
            "nT",
            "lasting error of magnetometer and model per axis, 1 sigma",
            low=1.0,
            high=1e5,
        ),
    )


class Convergence(NamedTuple):
    """When which step of finding Sun and roll is taken."""

    minimum_output: float = given(MINIMUM_OUTPUT)
    search_variance: float = made(
        lambda degrees: math.radians(degrees) ** 2,
        real(
            "search.until_deg", 20.0, "deg", "spread at which the search for the Sun ends, 1 sigma", low=1.0, high=60.0
        ),
    )
    roll_variance: float = made(
        lambda degrees: math.radians(degrees) ** 2,
        real(
            "roll.from_deg", 4.0, "deg", "error of the heading at which roll is looked for, 1 sigma", low=0.1, high=45.0
        ),
    )
    longest_step: float = given(
        real(
            "longest_step",
            10.0,
            "s",
            "after a longer step the Sun is looked for anew",
            low=0.0,
            open_low=True,
            high=1e6,
        )
    )
    gate: float = given(
        real("nis_gate", 25.0, "-", "normalised innovation squared beyond which a cell is refused", low=1.0, high=1e6)
    )


class SunFilterParameters(NamedTuple):
    """All of the estimator."""

    cells: np.ndarray = computed(_cells, GAINS, DARKS, NORMALS, OUTPUT_LOW)
    screen: Screen = computed(_screen)
    cos_half_view: float = computed(half_view_cosine)
    layout: CellLayout = computed(_layout, NORMALS)
    gate: Gate = computed(_gate)
    response: Response = part(Response)
    errors: CellErrors = part(CellErrors)
    calibration: Calibration = part(Calibration)
    earth: EarthErrors = part(EarthErrors)
    motion: Motion = part(Motion)
    field: Field = part(Field)
    convergence: Convergence = part(Convergence)
    eclipse: EclipseParameters = part(EclipseParameters)


PARAMETERS = merged(table_of(SunFilterParameters), flight_sky.PARAMETERS)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    cells = len(values.cells.normals)
    for parameter, what in ((GAINS, "numbers"), (DARKS, "numbers"), (NORMALS, "rows")):
        given_ones = len(values[parameter])
        if given_ones not in (0, cells):
            yield f"{parameter.name}: {given_ones} {what} given, expected one for each of {cells} cells, or none"
    if len(values[GAINS]) and not np.all(np.asarray(values[GAINS]) > 0.0):
        yield f"{GAINS.name}: {np.min(values[GAINS]):g} given, expected gains above 0; a dead cell is left out as NaN"
    if len(values[NORMALS]) and np.any(np.linalg.norm(np.reshape(values[NORMALS], (-1, 3)), axis=1) < _NO_NORMAL):
        yield f"{NORMALS.name}: a row of zeros given, expected normals"
    for parameter, measured in ((GAINS, MEASURED_SCALES), (DARKS, MEASURED_DARKS), (NORMALS, MEASURED_NORMALS)):
        if len(values[parameter]) and len(values[measured]):
            yield f"{parameter.name}: given together with {measured.name}, expected one of the two"
    if values[calibration_options.MODE] == "estimate" and not flight_sky.knows_place(values):
        yield (
            f"{calibration_options.MODE.name}: estimate given, but the place in orbit is not known, and the light of "
            "the Earth would be taken for gains; expected consider, or use_orbit and an orbit"
        )
    if values[CURVE] == "table" and len(values[TABLE]) < _FEWEST:
        yield f"{TABLE.name}: {len(values[TABLE])} numbers given, but the curve is `table`; expected at least {_FEWEST}"
    if len(values.spacecraft.inertia):
        moments = np.linalg.eigvalsh(np.asarray(values.spacecraft.inertia, dtype=np.float64).reshape(3, 3))
        if not moments[0] > 0.0:
            yield f"spacecraft.inertia: a principal moment of {moments[0]:g} kg m^2 given, expected above 0"
