# SPDX-License-Identifier: Apache-2.0
"""Direction to the Sun by all cells and the rates together: a vote over minutes instead of instants.

In the frame in which the gyro began to count, the Sun stands still but for what the gyro errs by. Over a minute in
which the body turns every cell sees it from many sides, and one that reads too little has nowhere to hide: at each
instant by itself another Sun would explain it. Of directions all over the sphere that counts which the outputs of a
window contradict least, each output at most once, with windows that follow on one another (min-sum, both ways). Where a
direction far from it is as good, nobody knows. Whether the Sun shines at all is a sequence of two states.
"""

import math

import numpy as np

from css_calibration.attitude_guess import integrated
from css_calibration.recorded import Recorded
from css_calibration.sun_by_cells import CLEAR, DIRECTIONS, FAR_COS, LEAST_LIT, Views, contradictions, views_of
from css_calibration.two_states import two_states
from css_common.kernel import kernel, typed_call
from css_common.vectors import Vec3, add, axes_across, row, scale, unit
from css_estimation.sun.direction_grid import direction

_WINDOW_S, _LONGEST_WINDOW_S = 60.0, 240.0
_FEWEST = 8  # instants of a window
_DRIFT = math.radians(8.0)  # of a gyro from a window to the next, as attitude_guess has it
_REACH_COS = math.cos(math.radians(40.0))
_INSTANTS = 10.0  # of a window that are worth evidence of their own
_STEPS_DEG = (3.0, 1.5, 0.75, 0.4)
_FOR_DARK, _CHANGE = 3.0, 14.0
_EXPLAINED, _LEAST_EXPLAINED = 0.75, 1.0 / 3.0


def sun_along_rates(recorded: Recorded) -> np.ndarray | None:
    """(M, 3) unit vectors in b, NaN where nobody knows; None: there are no rates, or the cells contradict them."""
    if len(recorded.gyro_ns) < 2:
        return None
    time = recorded.time
    length = max(_WINDOW_S, _FEWEST * float(np.median(np.diff(time))))
    if length > _LONGEST_WINDOW_S:
        return None
    phi, _, stretch = integrated(recorded)
    held = np.flatnonzero(stretch >= 0)
    if not len(held):
        return None
    number = stretch[held] * (int(time[-1] / length) + 2) + (time[held] / length).astype(np.int64)
    numbers, window = np.unique(number, return_inverse=True)
    linked = np.append(np.diff(numbers) == 1, False)
    views, voltages = views_of(recorded), np.ascontiguousarray(recorded.voltages[held])
    turned = np.ascontiguousarray(phi[held])
    grid = np.array([direction.py_func(g, DIRECTIONS) for g in range(DIRECTIONS)])
    lit = np.nanmax(np.where(np.isfinite(voltages), voltages, -np.inf), axis=1) > LEAST_LIT
    costs, least = np.zeros((len(numbers), DIRECTIONS)), np.zeros(len(held))
    _costs(views, grid, turned, window, voltages, lit, costs, least)
    counts = np.maximum(np.bincount(window[lit], minlength=len(numbers)), 1)
    together = _chained(costs * (_INSTANTS / counts)[:, None], linked, grid)
    best = np.argmin(together, axis=1)
    far = grid[best] @ grid.T < FAR_COS
    rival = np.where(far, together, np.inf).min(axis=1)
    clear = rival - together[np.arange(len(best)), best] >= CLEAR * _INSTANTS
    sun_g, at_sun, at_dark = grid[best].copy(), np.zeros(len(held)), np.zeros(len(held))
    _refine(views, turned, window, voltages, lit, sun_g, at_sun, at_dark)
    known = clear[window]
    counted = known & lit
    explained = at_sun[counted] < least[counted] + _EXPLAINED
    if not counted.any() or explained.mean() < _LEAST_EXPLAINED:
        return None
    dark = two_states(np.clip(_FOR_DARK * (at_sun - at_dark), -_FOR_DARK, _FOR_DARK) * known, _CHANGE) == 1
    known &= ~dark
    out = np.full((len(recorded.stamp_ns), 3), np.nan)
    out[held[known]] = np.einsum("kij,kj->ki", turned[known], sun_g[window[known]])
    return out


@kernel
def _in_body(phi, k: int, s: Vec3) -> Vec3:
    return (
        phi[k, 0, 0] * s[0] + phi[k, 0, 1] * s[1] + phi[k, 0, 2] * s[2],
        phi[k, 1, 0] * s[0] + phi[k, 1, 1] * s[1] + phi[k, 1, 2] * s[2],
        phi[k, 2, 0] * s[0] + phi[k, 2, 1] * s[1] + phi[k, 2, 2] * s[2],
    )


@kernel
def _costs_of(views: Views, grid, phi, window, voltages, lit, costs, least) -> None:
    for k in range(window.shape[0]):
        if not lit[k]:
            continue
        least[k] = math.inf
        for g in range(grid.shape[0]):
            cost = contradictions(views, voltages, k, _in_body(phi, k, row(grid, g)), True)
            costs[window[k], g] += cost
            least[k] = min(least[k], cost)


_costs = typed_call(_costs_of)


def _chained(costs: np.ndarray, linked: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """(K, G) least cost of all windows together by the direction in each."""
    cosine = np.clip(grid @ grid.T, -1.0, 1.0)
    near = [np.flatnonzero(of_one > _REACH_COS) for of_one in cosine]
    width = max(map(len, near))
    places = np.array([np.pad(one, (0, width - len(one)), mode="edge") for one in near])
    penalties = 0.5 * (np.arccos(np.take_along_axis(cosine, places, axis=1)) / _DRIFT) ** 2
    before, after = costs.copy(), costs.copy()
    for k in range(1, len(costs)):
        if linked[k - 1]:
            before[k] += (before[k - 1][places] + penalties).min(axis=1)
    for k in range(len(costs) - 2, -1, -1):
        if linked[k]:
            after[k] += (after[k + 1][places] + penalties).min(axis=1)
    return before + after - costs


@kernel
def _window_cost(views: Views, phi, voltages, lit, first: int, end: int, s: Vec3) -> float:
    cost = 0.0
    for k in range(first, end):
        if lit[k]:
            cost += contradictions(views, voltages, k, _in_body(phi, k, s), True)
    return cost


@kernel
def _refine_of(views: Views, phi, window, voltages, lit, sun_g, at_sun, at_dark) -> None:
    first = 0
    while first < window.shape[0]:
        w, end = window[first], first
        while end < window.shape[0] and window[end] == w:
            end += 1
        s = row(sun_g, w)
        cost = _window_cost(views, phi, voltages, lit, first, end, s)
        for degrees in _STEPS_DEG:
            for _ in range(4):
                a, b = axes_across(s)
                step, moved = math.radians(degrees), False
                for j in range(8):
                    angle = 0.25 * math.pi * j
                    tried = unit(add(s, add(scale(step * math.cos(angle), a), scale(step * math.sin(angle), b))))
                    other = _window_cost(views, phi, voltages, lit, first, end, tried)
                    if other < cost:
                        s, cost, moved = tried, other, True
                if not moved:
                    break
        sun_g[w, 0], sun_g[w, 1], sun_g[w, 2] = s
        for k in range(first, end):
            at_sun[k] = contradictions(views, voltages, k, _in_body(phi, k, s), True)
            at_dark[k] = contradictions(views, voltages, k, s, False)
        first = end


_refine = typed_call(_refine_of)
