# SPDX-License-Identifier: Apache-2.0
"""First guess of the attitude along a recording without truth: rates integrated, and turns about the field tried out.

Over a window of a minute rate and field leave one angle open, the turn about the field. For each of many such turns the
cells tell how well they fit. The sequence of turns that fits cells best while windows follow on one another, as
the gyro says that they must, is found by dynamic programming (Viterbi).
"""

import numpy as np
from scipy.spatial.transform import Rotation

from css_calibration.attitude_track import KNOT_S, Track
from css_calibration.cell_data import sun_in_view
from css_calibration.errors import CalibrationError
from css_calibration.recorded import Recorded
from css_calibration.surroundings import Surroundings
from css_common.attitude import rotation_vector_to_dcm
from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3

_TURNS = 72
_CELL_ERROR = 0.15  # [-] of uncalibrated cells in the light of the Earth
_DRIFT = np.radians(8.0)  # by which a gyro's bias turns a window against the next
_LONGEST_GAP = 5.0  # periods of the gyro
_LEAST_SIGMA = np.radians(0.02)  # of a link: rates between samples
_FEWEST = 4  # instants of a window
_FIELD_SIGMA = 300e-9  # [T]
_WHOLE = 1e-3


def gyro_noise(recorded: Recorded) -> float:
    """White noise of a rate [rad/s], 1 sigma per axis, by third differences, which a turning body hardly has."""
    if len(recorded.gyro_b) < 20:
        return 0.0
    thirds = np.diff(recorded.gyro_b, n=3, axis=0)
    return 1.4826 * float(np.median(np.abs(thirds))) / np.sqrt(20.0)


def integrated(recorded: Recorded) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the gyro counts at the instants: rotation (M, 3, 3), its integral (M, 3, 3), number of the stretch (M,).

    A stretch ends where the gyro is silent for more than five of its periods; -1: an instant that no stretch holds.
    """
    stamps, wanted = recorded.gyro_ns, recorded.stamp_ns
    if len(stamps) < 2:
        raise CalibrationError(f"{recorded.origin}: {len(stamps)} rates of a gyro, expected some for each minute")
    union = np.unique(np.concatenate([stamps, wanted[(wanted >= stamps[0]) & (wanted <= stamps[-1])]]))
    time = (union - union[0]) * 1e-9
    at = (stamps - union[0]) * 1e-9
    rates = np.stack([np.interp(time, at, recorded.gyro_b[:, j]) for j in range(3)], axis=1)
    gaps = np.diff(stamps)
    broken = stamps[1:][gaps > _LONGEST_GAP * np.median(gaps)]
    stretch = np.searchsorted(broken, union, side="right")
    phi, integral = np.empty((len(union), 3, 3)), np.empty((len(union), 3, 3))
    _integrate(time, rates, stretch, phi, integral)
    places = np.clip(np.searchsorted(union, wanted), 0, len(union) - 1)
    held = union[places] == wanted
    # inside a gap the rate is made up
    after = np.clip(np.searchsorted(stamps, wanted), 1, len(stamps) - 1)
    held &= (stamps[after] - stamps[after - 1]) <= _LONGEST_GAP * np.median(gaps)
    return phi[places], integral[places], np.where(held, stretch[places], -1)


@kernel
def _product(a: Mat3, m, k: int, out) -> None:
    for i in range(3):
        for j in range(3):
            out[k + 1, i, j] = a[i][0] * m[k, 0, j] + a[i][1] * m[k, 1, j] + a[i][2] * m[k, 2, j]


@kernel
def _integrate(time, rates, stretch, phi, integral) -> None:
    for i in range(3):
        for j in range(3):
            phi[0, i, j] = 1.0 if i == j else 0.0
            integral[0, i, j] = 0.0
    for k in range(time.shape[0] - 1):
        dt = time[k + 1] - time[k]
        if stretch[k + 1] != stretch[k]:
            for i in range(3):
                for j in range(3):
                    phi[k + 1, i, j] = 1.0 if i == j else 0.0
                    integral[k + 1, i, j] = 0.0
            continue
        mean: Vec3 = (
            0.5 * dt * (rates[k, 0] + rates[k + 1, 0]),
            0.5 * dt * (rates[k, 1] + rates[k + 1, 1]),
            0.5 * dt * (rates[k, 2] + rates[k + 1, 2]),
        )
        _product(rotation_vector_to_dcm(mean), phi, k, phi)
        for i in range(3):
            for j in range(3):
                integral[k + 1, i, j] = integral[k, i, j] + 0.5 * dt * (phi[k, j, i] + phi[k + 1, j, i])


def first_track(recorded: Recorded, around: Surroundings) -> tuple[Track, np.ndarray]:
    """A track with its first guess, and the instants (K,) that it holds: those in sunlight.

    Raises:
        CalibrationError: there is no minute with rates, field and sunlit cells.
    """
    phi, integral, stretch = integrated(recorded)
    assert recorded.field_b is not None
    lit = (around.shadow < _WHOLE) & (stretch >= 0) & np.isfinite(around.sun_n).all(axis=1)
    rows, knot, times, of_run = _windows(recorded, lit, stretch)
    if not len(rows):
        raise CalibrationError(
            f"{recorded.origin}: rates, field and sunlight never last together for a minute; expected several minutes "
            "of all three"
        )
    windows = [rows[knot == k] for k in range(len(times))]
    candidates: list[np.ndarray] = []
    costs: list[np.ndarray] = []
    for k, window in enumerate(windows):
        # the last knot of a run has no instants of its own
        if not len(window):
            candidates.append(candidates[-1])
            costs.append(np.zeros(_TURNS))
            continue
        e, cost = _turns_about_field(recorded, around, phi, window, k)
        candidates.append(e)
        costs.append(cost)
    start = _most_likely(np.array(candidates), np.array(costs), of_run)
    linked = np.append(of_run[1:] == of_run[:-1], False)
    at = [_at_time(recorded.time, integral, rows, t, w) for t, w in zip(times, windows, strict=True)]
    after = np.minimum(knot + 1, len(times) - 1)
    length = np.where(linked[knot], times[after] - times[knot], KNOT_S)
    share = np.clip((recorded.time[rows] - times[knot]) / length, 0.0, 1.0)
    period = float(np.median(np.diff(recorded.gyro_ns))) * 1e-9
    sigma = np.sqrt(gyro_noise(recorded) ** 2 * period * np.append(np.diff(times), KNOT_S).clip(1.0) + _LEAST_SIGMA**2)
    track = Track(
        phi[rows], integral[rows], knot, share, start, np.array(at), linked, sigma, around.sun_n[rows],
        around.field_n[rows], recorded.field_b[rows], _FIELD_SIGMA,
    )  # fmt: skip
    return track, rows


def _windows(
    recorded: Recorded, lit: np.ndarray, stretch: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Instants in windows, the knot before each, time of each knot [s], and the run that each knot belongs to."""
    chosen: list[np.ndarray] = []
    knots: list[np.ndarray] = []
    times: list[float] = []
    runs: list[int] = []
    time = recorded.time
    rows = np.flatnonzero(lit)
    new_run = np.flatnonzero((np.diff(stretch[rows]) != 0) | (np.diff(time[rows]) > 2.0 * KNOT_S)) + 1
    for number, run in enumerate(np.split(rows, new_run)):
        if len(run) < _FEWEST or time[run[-1]] - time[run[0]] < KNOT_S:
            continue
        count = max(1, round((time[run[-1]] - time[run[0]]) / KNOT_S))
        edges = np.linspace(time[run[0]], time[run[-1]], count + 1)
        place = np.clip(np.searchsorted(edges, time[run], side="right") - 1, 0, count - 1)
        chosen.append(run)
        knots.append(place + len(times))
        times += edges.tolist()
        runs += [number] * (count + 1)
    if not chosen:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64)
    return np.concatenate(chosen), np.concatenate(knots), np.array(times), np.array(runs)


def _at_time(
    time: np.ndarray, integral: np.ndarray, rows: np.ndarray, instant: float, window: np.ndarray
) -> np.ndarray:
    """The integral at the time of a knot."""
    near = rows if not len(window) else window
    return integral[near[np.argmin(np.abs(time[near] - instant))]]


def _turns_about_field(
    recorded: Recorded, around: Surroundings, phi: np.ndarray, window: np.ndarray, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """Attitudes E (T, 3, 3) that explain the field of a window, and what each costs the cells."""
    assert recorded.field_b is not None
    measured = window[np.isfinite(recorded.field_b[window]).all(axis=1)]
    identity = np.tile(np.eye(3), (_TURNS, 1, 1))
    if not len(measured):
        return identity, np.zeros(_TURNS)
    # in the frame in which the gyro began to count the field stands nearly still, as in n
    of_gyro = np.einsum("kji,kj->ki", phi[measured], recorded.field_b[measured])
    a, b = of_gyro.mean(axis=0), around.field_n[measured].mean(axis=0)
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    base, _ = Rotation.align_vectors(a[None], b[None])
    angles = 2.0 * np.pi * np.arange(_TURNS) / _TURNS
    e = (Rotation.from_rotvec(angles[:, None] * a) * base).as_matrix()
    some = window[:: max(1, len(window) // 30)]
    sun_b = np.einsum("kij,tjl,kl->tki", phi[some], e, around.sun_n[some])
    cost = np.empty(_TURNS)
    normals = np.asarray(recorded.mission.values.cells.normals)
    voltages = recorded.voltages[some]
    for t in range(_TURNS):
        seen, _ = sun_in_view(recorded, sun_b[t])
        light = np.where(seen, np.maximum(sun_b[t] @ normals.T, 0.0), 0.0)
        off = np.clip(np.nan_to_num(voltages - light) / _CELL_ERROR, -4.0, 4.0)
        cost[t] = 0.5 * np.sum(off**2) / 4.0
    return e, cost


def _most_likely(candidates: np.ndarray, costs: np.ndarray, of_run: np.ndarray) -> np.ndarray:
    """One attitude a window (K, 3, 3): cells and continuity together."""
    count = len(candidates)
    best, came = costs[0].copy(), np.zeros((count, _TURNS), np.int64)
    for k in range(1, count):
        if of_run[k] != of_run[k - 1]:
            came[k] = int(np.argmin(best))
            best = best.min() + costs[k]
            continue
        trace = np.einsum("aij,bij->ab", candidates[k - 1], candidates[k])
        angle = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
        total = best[:, None] + 0.5 * (angle / _DRIFT) ** 2
        came[k] = np.argmin(total, axis=0)
        best = total.min(axis=0) + costs[k]
    chosen = [int(np.argmin(best))]
    for k in range(count - 1, 0, -1):
        chosen.append(int(came[k][chosen[-1]]))
    return candidates[np.arange(count), chosen[::-1]]
