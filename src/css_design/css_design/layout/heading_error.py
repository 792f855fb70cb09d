# SPDX-License-Identifier: Apache-2.0
"""Heading error that a layout leaves, from its readings alone: covariance and bias of one estimate.

What was known before is the Sun's direction to `prior` about both axes across it, as motion and rates carry it on. Each
cell that sees the Sun is taken for its cosine, with an error of `sigma`; what Earth and response add to its reading
shifts the estimate, which is the unit vector that makes

    |s_est - s|^2 / prior^2 + sum (v_i - n_i . s_est)^2 / sigma^2

smallest (Gauss-Newton on the sphere; the shift is not in proportion to the readings where a cell faces the Sun). With
g_i the parts of the normals across it, J = I / prior^2 + sum g_i g_i^T / sigma^2,

    error^2 = angle(s_est, s)^2 + tr J^-1.

With a cell dead the estimate makes one more step without it. Where no cell sees the Sun the error is that of a guess.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel, outer_kernel
from css_common.vectors import Vec3, add, angle_between, axes_across, dot, row, scale, subtract, unit
from css_design.layout.readings import Readings
from css_design.layout.scenes import Scenes

TAIL = 0.05
"""Share of the scenes that count as the tail."""

_STEPS = 4
_LONGEST_STEP = 0.4  # [rad]
_A_GUESS = 0.5 * math.pi  # [rad] mean error of any direction


class Knowledge(NamedTuple):
    """What an estimator goes by."""

    sigma: float  # [-] error of a cell, all causes
    prior: float  # [rad] error of the heading before the update, about each axis


class HeadingError(NamedTuple):
    """Of a layout, root mean square over two axes [rad]."""

    mean: float  # by the weights of the scenes
    worst: float  # of all scenes
    failed: float  # largest mean with any one cell dead
    failed_worst: float  # largest of all scenes with any one cell dead
    unseen: float  # share of the weight of the scenes in which no cell sees the Sun
    tail: float  # mean of the worst scenes that have a twentieth of the weight


def heading_error(
    normals_b: np.ndarray, readings: Readings, scenes: Scenes, knowledge: Knowledge, chosen: np.ndarray
) -> HeadingError:
    """Error of a layout of some cells (N,), numbers of rows of `readings`."""
    out, room, errors = np.zeros(5), np.zeros((len(chosen), 5)), np.zeros(len(scenes.weight))
    _measure(
        np.ascontiguousarray(normals_b),
        readings.seen,
        readings.outputs,
        scenes.suns_b,
        scenes.weight,
        knowledge,
        np.asarray(chosen, dtype=np.int64),
        room,
        errors,
        out,
    )
    mean, worst, failed, failed_worst, unseen = out.tolist()
    return HeadingError(mean, worst, failed, failed_worst, unseen, tail_mean(errors, scenes.weight))


def tail_mean(errors: np.ndarray, weight: np.ndarray, share: float = TAIL) -> float:
    """Mean of the largest errors (S,) that have a share of the weight: expected shortfall."""
    order = np.argsort(-errors, kind="stable")
    larger = np.cumsum(weight[order]) - weight[order]
    return float(np.clip(share - larger, 0.0, weight[order]) @ errors[order] / share)


@kernel
def _stepped(s: Vec3, a: Vec3, c: Vec3, j11, j12, j22, b1, b2) -> tuple[Vec3, float]:
    """Estimate after one step of J d = b along two axes, of bounded length, and tr J^-1 [rad^2]."""
    determinant = j11 * j22 - j12 * j12
    d1, d2 = (j22 * b1 - j12 * b2) / determinant, (j11 * b2 - j12 * b1) / determinant
    size = math.sqrt(d1 * d1 + d2 * d2)
    if size > _LONGEST_STEP:
        d1, d2 = d1 * _LONGEST_STEP / size, d2 * _LONGEST_STEP / size
    return unit(add(s, add(scale(d1, a), scale(d2, c)))), (j11 + j22) / determinant


@kernel
def _error(estimate: Vec3, sun_b: Vec3, variance: float) -> float:
    angle = angle_between(estimate, sun_b)
    return min(math.sqrt(angle * angle + variance), math.pi)


@outer_kernel
def _measure(normals_b, seen, outputs, suns_b, weight, knowledge: Knowledge, chosen, room, errors, out) -> None:
    count = chosen.shape[0]
    before, per_cell = 1.0 / knowledge.prior**2, 1.0 / knowledge.sigma**2
    failed = np.zeros(count)
    for s in range(weight.shape[0]):
        sun_b = row(suns_b, s)
        estimate, lit = sun_b, 0
        j11 = j12 = j22 = b1 = b2 = 0.0
        a, c = axes_across(estimate)
        for step in range(_STEPS + 1):
            a, c = axes_across(estimate)
            back = subtract(sun_b, estimate)
            j11, j12, j22 = before, 0.0, before
            b1, b2, lit = before * dot(a, back), before * dot(c, back), 0
            for k in range(count):
                i = chosen[k]
                if not seen[i, s]:
                    continue
                lit += 1
                n = row(normals_b, i)
                g1, g2, wrong = dot(n, a), dot(n, c), outputs[i, s] - dot(n, estimate)
                room[k, 0], room[k, 1], room[k, 2] = per_cell * g1 * g1, per_cell * g1 * g2, per_cell * g2 * g2
                room[k, 3], room[k, 4] = per_cell * g1 * wrong, per_cell * g2 * wrong
                j11, j12, j22 = j11 + room[k, 0], j12 + room[k, 1], j22 + room[k, 2]
                b1, b2 = b1 + room[k, 3], b2 + room[k, 4]
            if step < _STEPS:
                estimate, _ = _stepped(estimate, a, c, j11, j12, j22, b1, b2)
        error = _error(estimate, sun_b, (j11 + j22) / (j11 * j22 - j12 * j12)) if lit else _A_GUESS
        errors[s] = error
        out[0] += weight[s] * error
        out[1] = max(out[1], error)
        if lit == 0:
            out[4] += weight[s]
        for k in range(count):
            one = error
            if seen[chosen[k], s]:
                without, variance = _stepped(
                    estimate, a, c,
                    j11 - room[k, 0], j12 - room[k, 1], j22 - room[k, 2], b1 - room[k, 3], b2 - room[k, 4],
                )  # fmt: skip
                one = _error(without, sun_b, variance) if lit > 1 else _A_GUESS
            failed[k] += weight[s] * one
            out[3] = max(out[3], one)
    for k in range(count):
        out[2] = max(out[2], failed[k])
