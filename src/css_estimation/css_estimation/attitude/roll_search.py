# SPDX-License-Identifier: Apache-2.0
"""Search for the attitude among all that the field allows: hypotheses of roll about it, weighed by the cells.

The field fixes two of three angles, wherever the filter believes to be. What remains is the roll about it, and of that
the outputs of the cells are no linear function: a filter that begins far off can settle where the cells agree for the
moment, be sure of it, and refuse all that contradicts it from then on. Here the whole circle is weighed in steps of 10
deg: a point-mass filter (Bucy & Senne 1971) on one angle. Hypotheses turn with the gyro and are laid on the measured
field again in every cycle; what the cells said is forgotten over half a minute, since a gyro's bias turns them too.

The verdict is a roll when nearly all weight lies around one, and the outputs fit it.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.attitude import mrp_add, mrp_to_dcm, rotation_vector_to_dcm, rotation_vector_to_mrp
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, angle_between, axes_across, cross, dot, matmul, multiply, norm, scale
from css_environment.albedo import albedo_output
from css_estimation.attitude.cell_voltages import CellModel
from css_estimation.attitude.flight_references import References
from css_estimation.sun.cell_calibration import SCALE
from css_estimation.sun.cell_layout import READABLE, sees

HYPOTHESES = 36
_STEP = 2.0 * math.pi / HYPOTHESES
# Within this many hypotheses of the best the weight counts as that of one roll.
_NEAR = 2
# Of all weight, how much must be there; and how many outputs, at what mean square of their normalised misfit.
_SURE, _LEAST_SEEN, _LARGEST_MISFIT = 0.999, 8.0, 3.0
# How long what the cells said counts [s].
_MEMORY = 30.0
# An output that fits no hypothesis (a failed cell) must not decide; nor do outputs count in full whose errors last.
_LARGEST_SQUARE, _TEMPER = 16.0, 0.25
# The hypotheses' own errors: half a step of roll, and of the field's direction [rad].
_WITHIN, _ACROSS = 0.5 * _STEP, 0.03
LEAST_VARIANCE = _WITHIN * _WITHIN
"""Variance [rad^2] of a roll that a hypothesis stands for."""

# Of the light of the Earth as each hypothesis predicts it, relative.
_EARTH_SIGMA = 0.5


class RollSearch(NamedTuple):
    """What is carried from cycle to cycle, beside the weights."""

    begun: bool
    sigma_bn: Vec3  # the hypothesis of roll zero
    seen: float  # outputs that count, faded
    idle: float  # [s] for how long the search has lacked field or Sun


class Verdict(NamedTuple):
    """What the search has found."""

    found: bool
    sigma_bn: Vec3
    variance: float  # of the roll [rad^2]


def new_weights() -> np.ndarray:
    """Room (36,) for the logarithms of the weights."""
    return np.zeros(HYPOTHESES)


@kernel
def no_search() -> RollSearch:
    """Nothing begun."""
    return RollSearch(False, (0.0, 0.0, 0.0), 0.0, 0.0)


@kernel
def begin(weights, sigma_bn: Vec3, variance: float) -> RollSearch:
    """A search about an attitude.

    Args:
        weights: (36,) written.
        variance: of its roll about the field [rad^2]; infinite: nothing is known.
    """
    for j in range(HYPOTHESES):
        roll = _roll(j)
        weights[j] = -0.5 * roll * roll / variance
    return RollSearch(True, sigma_bn, 0.0, 0.0)


@kernel
def turned(search: RollSearch, turn: Vec3, dt: float) -> RollSearch:
    """The search once the body has turned by a rotation vector [rad] in `dt` [s]."""
    return RollSearch(
        search.begun, mrp_add(search.sigma_bn, rotation_vector_to_mrp(turn)), search.seen, search.idle + dt
    )


@kernel
def laid_on(sigma_bn: Vec3, field_n: Vec3, along_b: Vec3) -> Vec3:
    """The attitude turned the shortest way to where the field lies along the unit vector `along_b`."""
    predicted_b = multiply(mrp_to_dcm(sigma_bn), field_n)
    axis = cross(along_b, predicted_b)
    length = norm(axis)
    if length > 1e-12 * norm(predicted_b):
        axis = scale(1.0 / length, axis)
    else:
        axis, _ = axes_across(along_b)
    return mrp_add(sigma_bn, rotation_vector_to_mrp(scale(angle_between(along_b, predicted_b), axis)))


@kernel
def weigh(
    cells: CellModel,
    calibration,
    search: RollSearch,
    weights,
    dt: float,
    voltages,
    mask: int,
    field_b: Vec3,
    references: References,
    light,
    brightness: float,
    work,
    room,
) -> RollSearch:
    """Lays the hypotheses on the field and weighs them by the cells in `mask`.

    Args:
        calibration: (N, 3) of the cells.
        weights: (36,) advanced.
        dt: since the last time [s].
        field_b: measured [T], without the magnetometer's bias.
        references: with the field that the filter believes in.
        light: (192,) patches of light of the Earth.
        brightness: of the Earth relative to them; 0: none is predicted.
        work: (224,) room for the light of the Earth.
        room: (N,) the same.
    """
    along_b = scale(1.0 / norm(field_b), field_b)
    sigma_bn = laid_on(search.sigma_bn, references.field_n, along_b)
    dcm_bn = mrp_to_dcm(sigma_bn)
    fading = math.exp(-dt / _MEMORY)
    seen = fading * search.seen
    for i in range(voltages.shape[0]):
        if mask >> i & 1 == 1 and -READABLE < voltages[i] < READABLE:
            seen += 1.0
    for j in range(HYPOTHESES):
        turned_bn = matmul(rotation_vector_to_dcm(scale(_roll(j), along_b)), dcm_bn)
        square = _misfit(
            cells, calibration, voltages, mask, along_b, turned_bn, references, light, brightness, work, room
        )
        weights[j] = fading * weights[j] - 0.5 * _TEMPER * square
    return RollSearch(True, sigma_bn, seen, 0.0)


@kernel
def verdict(search: RollSearch, weights, field_b: Vec3) -> Verdict:
    """The roll that the weights agree on, if they do.

    Args:
        weights: (36,) as `weigh` left them with the field `field_b`.
    """
    best = 0
    for j in range(1, HYPOTHESES):
        if weights[j] > weights[best]:
            best = j
    total, near, first, second = 0.0, 0.0, 0.0, 0.0
    for j in range(HYPOTHESES):
        share = math.exp(weights[j] - weights[best])
        total += share
        off = (j - best + HYPOTHESES // 2) % HYPOTHESES - HYPOTHESES // 2
        if abs(off) <= _NEAR:
            near += share
            first += share * off
            second += share * off * off
    mean = first / near
    misfit = -2.0 * weights[best] / _TEMPER / max(search.seen, 1.0)
    found = near > _SURE * total and search.seen >= _LEAST_SEEN and misfit < _LARGEST_MISFIT
    along_b = scale(1.0 / norm(field_b), field_b)
    turn = scale(_roll(best) + mean * _STEP, along_b)
    variance = _STEP * _STEP * (second / near - mean * mean) + _WITHIN * _WITHIN + _ACROSS * _ACROSS
    return Verdict(found, mrp_add(search.sigma_bn, rotation_vector_to_mrp(turn)), variance)


@kernel
def _roll(j: int) -> float:
    """Roll of a hypothesis [rad], -pi to pi; the first has none."""
    return _STEP * ((j + HYPOTHESES // 2) % HYPOTHESES - HYPOTHESES // 2)


@kernel
def _misfit(
    cells: CellModel,
    calibration,
    voltages,
    mask: int,
    along_b: Vec3,
    dcm_bn: Mat3,
    references: References,
    light,
    brightness: float,
    work,
    room,
) -> float:
    """Sum of the normalised squares by which outputs miss a hypothesis."""
    layout = cells.layout
    if brightness > 0.0:
        albedo_output(light, layout.cells, layout.screen, layout.cos_half_view, dcm_bn, work, room)
    sun_b = multiply(dcm_bn, references.sun_n)
    sideways_b = cross(along_b, sun_b)
    total = 0.0
    for i in range(voltages.shape[0]):
        if mask >> i & 1 == 0 or not -READABLE < voltages[i] < READABLE:
            continue
        cell = layout.cells[i]
        normal_b = (cell.nx, cell.ny, cell.nz)
        gain = calibration[i, SCALE]
        from_sun = gain * references.intensity * max(0.0, dot(normal_b, sun_b)) if sees(layout, i, sun_b) else 0.0
        from_earth = gain * brightness * room[i] if brightness > 0.0 else 0.0
        rolled = gain * _WITHIN * dot(normal_b, sideways_b)
        across, earth = gain * _ACROSS, _EARTH_SIGMA * from_earth
        variance = cells.variance + cells.calibration.scale_variance * from_sun * from_sun
        variance += rolled * rolled + across * across + earth * earth
        off = voltages[i] - from_sun - from_earth
        total += min(off * off / variance, _LARGEST_SQUARE)
    return total
