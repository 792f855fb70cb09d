# SPDX-License-Identifier: Apache-2.0
"""Batch least squares over a whole recording: cells; without a truth attitude, gyro and magnetometer as well.

Three passes of `scipy.optimize.least_squares`, all derivatives in closed form. The first has a soft-L1 loss, so that
outliers do not lead it astray; then the noise is read off the residuals, what is beyond 5 sigma is left out and named,
and the loss is square. In the last pass the Earth shines on the normals found.

An output errs by white noise, by an error relative to it, and by clouds on the light of the Earth. The relative error
is as alike in all cells of an instant as the residuals are; clouds stay for as long as the Sun filter has it, and less
long on a body that turns. Weights are those of the whole covariance of these errors (`noise_whitening`): with each
output weighed by itself, an error that all cells have in common hides the ratios between them, which tell tilts and
scales. The covariance of the result is scaled by what sums of white residuals over stretches of two minutes are above
expectation, and has the light of an Earth that nobody predicts for all of the recording (Huber's sandwich).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from css_calibration.attitude_track import Track
from css_calibration.cell_data import CellData
from css_calibration.cell_fit_model import DARK, EARTH, PER_CELL, normals_of
from css_calibration.noise_model import Noise, noise_of, slow_factor
from css_calibration.noise_whitening import Errors
from css_calibration.unknowns import Unknowns

OUTLIER = 5.0
"""Standard deviations beyond which an output is left out."""
_SOFT = 2.0
_PASSES = 2  # with a square loss
_TOLERANCE = 1e-6
_MEAN_SHARE = math.sqrt(0.5)  # of the root mean square of a light whose mean is as large as its changes


@dataclass
class Fit:
    """What a batch came to.

    Attributes:
        unknowns: what was looked for.
        x: (P,) in units of ignorance: of the cells, then of the track.
        covariance: (P, P) of it.
        of_outputs: (P, P) the part of it by which outputs that are predicted err: without the light of an Earth that
            nobody predicts, for that is in what is predicted as it is in what was read.
        information: (P, P) normal matrix of the data alone.
        residuals: (M, N) of the outputs [-], NaN where they do not count.
        outliers: (M, N) left out.
        noise: of the outputs.
        slow: factor on the standard deviations by residuals that last.
        cost: half the sum of squares.
        beside_earth: `x` and `covariance` where the light of an Earth that nobody predicts is sought as well; None:
            it is predicted.
    """

    unknowns: Unknowns
    x: np.ndarray
    covariance: np.ndarray
    of_outputs: np.ndarray
    information: np.ndarray
    residuals: np.ndarray
    outliers: np.ndarray
    noise: Noise
    slow: float
    cost: float
    beside_earth: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def parameters(self) -> np.ndarray:
        """(N, 5) of the cells."""
        return self.unknowns.parameters(self.x)[0]

    def prediction_variance(self, slopes: np.ndarray) -> np.ndarray:
        """(M, N) variance of outputs that are predicted by what was found, by their derivatives (M, N, 6)."""
        columns, scale = self.unknowns.column_of(), self.unknowns.sigma
        variance = np.zeros(slopes.shape[:2])
        for i, of_cell in enumerate(columns):
            kinds = np.flatnonzero(of_cell >= 0)
            places = of_cell[kinds]
            if self.unknowns.earth:
                kinds, places = np.append(kinds, EARTH), np.append(places, self.unknowns.count - 1)
            by = slopes[:, i][:, kinds] * scale[places]
            variance[:, i] = np.einsum("ka,ab,kb->k", by, self.of_outputs[np.ix_(places, places)], by)
        return variance

    @property
    def earth(self) -> float:
        """Brightness of the Earth relative to the mean one."""
        return self.unknowns.parameters(self.x)[1]


class _Problem:
    """Residuals and derivatives for given weights."""

    def __init__(
        self, data: CellData, unknowns: Unknowns, track: Track | None, counts: np.ndarray, noise: Noise
    ) -> None:
        self.data, self.unknowns, self.track = data, unknowns, track
        self.rows, self.cells = np.nonzero(counts)
        self.noise = noise
        self.sigma = np.ones(len(self.rows))
        self.errors: Errors | None = None
        self._columns = unknowns.column_of()

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x[: self.unknowns.count], x[self.unknowns.count :]

    def weigh(self, x: np.ndarray, *, whole: bool) -> None:
        """Takes the errors for what is expected at `x`.

        Args:
            whole: with what one output has in common with another; else each has its own error.
        """
        parameters, earth = self.unknowns.parameters(x)
        out, slopes, _ = self._placed(x)[0].predicted(parameters, earth)
        earthly, at = slopes[:, :, EARTH], (self.rows, self.cells)
        if whole:
            lit = (out - parameters[:, DARK])[at]
            self.errors = self.noise.errors(*at, lit, earthly[at], self.data.turned, self.data.time)
        else:
            self.sigma = np.sqrt(self.noise.variance(out, earthly, parameters))[at]

    def weighed(self, values: np.ndarray) -> np.ndarray:
        """Residuals (K,) or derivatives (K, C) of outputs in units of their errors."""
        rows = values.reshape(len(values), -1)
        rows = rows / self.sigma[:, None] if self.errors is None else self.errors.whitened(rows)
        return rows.reshape(values.shape)

    def _placed(self, x: np.ndarray) -> tuple[CellData, np.ndarray | None, np.ndarray | None]:
        if self.track is None:
            return self.data, None, None
        dcm_bn, e = self.track.attitudes(self.split(x)[1])
        self.data.sun_b = np.ascontiguousarray(np.einsum("kij,kj->ki", dcm_bn, self.track.sun_n))
        return self.data, dcm_bn, e

    def residuals(self, x: np.ndarray) -> np.ndarray:
        data, dcm_bn, e = self._placed(x)
        out, _, _ = data.predicted(*self.unknowns.parameters(x))
        off = self.weighed((out - data.voltages)[self.rows, self.cells])
        parts = [off]
        if self.track is not None:
            assert dcm_bn is not None and e is not None
            of_track = self.split(x)[1]
            parts += [self.track.field(of_track, dcm_bn, e)[0], self.track.links(of_track)[0]]
        return np.concatenate([*parts, x])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        return np.vstack([self.of_data(x), np.eye(len(x))])

    def of_data(self, x: np.ndarray) -> np.ndarray:
        """Derivatives of all but what was known before."""
        data, dcm_bn, e = self._placed(x)
        _, slopes, turns = data.predicted(*self.unknowns.parameters(x))
        count = self.unknowns.count
        out = np.zeros((len(self.rows), len(x)))
        at = np.arange(len(self.rows))
        scale = self.unknowns.sigma
        for k in range(PER_CELL):
            column = self._columns[self.cells, k]
            there = column >= 0
            out[at[there], column[there]] = (slopes[self.rows, self.cells, k])[there] * scale[column[there]]
        if self.unknowns.earth:
            out[:, count - 1] = slopes[self.rows, self.cells, EARTH] * scale[-1]
        if self.track is None:
            return self.weighed(out)
        assert dcm_bn is not None and e is not None
        part = self.track._rows(self.rows)
        out[:, count:] = part.by_unknowns(e[self.rows], self.track.sun_n[self.rows], turns[self.rows, self.cells])
        of_track = self.split(x)[1]
        _, field = self.track.field(of_track, dcm_bn, e)
        _, links = self.track.links(of_track)
        below = np.zeros((len(field) + len(links), len(x)))
        below[:, count:] = np.vstack([field, links])
        return np.vstack([self.weighed(out), below])


def fit(data: CellData, unknowns: Unknowns, track: Track | None = None, start: np.ndarray | None = None) -> Fit:
    """The batch.

    Args:
        data: of a recording; where a track is given, its Sun vectors are renewed by it.
        unknowns: of the cells.
        track: attitudes that are sought as well.
        start: first guess of all unknowns; None: as the mission has them.
    """
    size = unknowns.count + (0 if track is None else track.count)
    x = np.zeros(size) if start is None else start
    counts = data.usable.copy()
    outliers = np.zeros_like(counts)
    noise = Noise(0.02, 0.02, 0.0, 0.3 if data.earth_known else 0.0)
    for number in range(_PASSES + 1):
        problem = _Problem(data, unknowns, track, counts & ~outliers, noise)
        problem.weigh(x, whole=number > 0)
        result = least_squares(
            problem.residuals, x, jac=problem.jacobian, loss="soft_l1" if number == 0 else "linear",
            f_scale=_SOFT, xtol=_TOLERANCE, ftol=_TOLERANCE, gtol=1e-9, max_nfev=40,
            x_scale="jac" if track is None else 1.0,
        )  # fmt: skip
        x = result.x
        off, expected, earthly, parameters = _off(problem, x, counts)
        light, counted = expected - parameters[:, DARK], counts & ~outliers
        noise = noise_of(off, light, earthly, counted, data.intensity > 0.0, data.earth_known)
        if number < _PASSES:
            sigma = np.sqrt(noise.variance(expected, earthly, parameters))
            outliers = counts & (np.abs(off) > OUTLIER * sigma)
    problem = _Problem(data, unknowns, track, counts & ~outliers, noise)
    problem.weigh(x, whole=True)
    covariance, of_outputs, information, slow, beside_earth = _covariance(problem, x)
    return Fit(
        unknowns,
        x,
        covariance,
        of_outputs,
        information,
        np.where(counts, -off, np.nan),
        outliers,
        noise,
        slow,
        float(result.cost),
        beside_earth,
    )


def _earth_patterns(problem: _Problem, x: np.ndarray) -> np.ndarray:
    """(K, 2 N) where light of an Earth that nobody predicts may lie: on a cell away from the Sun, and on one facing it.

    The two are as good as independent. Where the Sun is overhead a cell sees either it or the lit Earth, which a fit
    makes a dark level and, of what is then missing head-on, too small a scale; where it is low a cell may see both.
    """
    data = problem._placed(x)[0]
    normals_b = normals_of(data.normals_b, problem.unknowns.parameters(x)[0])
    facing = np.clip(data.incidence_cosine(normals_b), 0.0, 1.0)[problem.rows, problem.cells]
    sunlit = data.intensity[problem.rows] > 0.0
    cells = np.equal.outer(problem.cells, np.arange(data.voltages.shape[1])) & sunlit[:, None]
    return np.hstack([cells * (1.0 - facing)[:, None], cells * facing[:, None]])


def _off(problem: _Problem, x: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, ...]:
    """Expected less read (M, N), what was expected, its slope by the Earth, and parameters (N, 5)."""
    parameters, earth = problem.unknowns.parameters(x)
    data = problem._placed(x)[0]
    out, slopes, _ = data.predicted(parameters, earth)
    return np.where(counts, out - data.voltages, 0.0), out, slopes[:, :, EARTH], parameters


def _covariance(
    problem: _Problem, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, tuple[np.ndarray, np.ndarray] | None]:
    """Those of all errors and of predicted outputs, normal matrix, factor of slow errors, `Fit.beside_earth`."""
    jacobian = problem.of_data(x)
    count = len(problem.rows)
    of_cells, others = jacobian[:count], jacobian[count:]
    information = jacobian.T @ jacobian
    off = problem.residuals(x)[:count]
    slow = slow_factor(off, problem.data.time[problem.rows], problem.cells)
    inverse = np.linalg.inv(information + np.eye(len(x)))
    of_outputs = inverse @ (slow**2 * of_cells.T @ of_cells + others.T @ others + np.eye(len(x))) @ inverse
    if problem.noise.unknown == 0.0:
        return of_outputs, of_outputs, information, slow, None
    patterns = problem.weighed(problem.noise.unknown * _earth_patterns(problem, x))
    by_light = inverse @ of_cells.T @ patterns
    beside_earth = _beside_earth(of_cells, patterns, off, x, slow)
    return of_outputs + by_light @ by_light.T, of_outputs, information, slow, beside_earth


def _beside_earth(
    jacobian: np.ndarray, patterns: np.ndarray, off: np.ndarray, x: np.ndarray, slow: float
) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns (P,) and their covariance, one step from where they are best without the light of the patterns.

    Args:
        jacobian: (K, P) of the outputs.
        patterns: (K, Q) of the light on the outputs, in units of their errors and of what it may be.
        off: (K,) expected less read, in the same units.
        x: (P,) of a fit without it.
        slow: factor on the errors of the outputs, which weigh by so much less.
    """
    whole, half = np.hstack([jacobian, patterns]) / slow, patterns.shape[1] // 2
    # on cells away from the Sun, the first half: never below zero, with a mean as large as its changes are
    away, facing = np.full(half, _MEAN_SHARE), np.ones(half)
    precision = np.concatenate([np.ones(len(x)), away**-2, facing])
    off_before = np.concatenate([x, -away, 0.0 * facing])
    covariance = np.linalg.inv(whole.T @ whole + np.diag(precision))
    change = -covariance @ (whole.T @ off / slow + precision * off_before)
    return x + change[: len(x)], covariance[: len(x), : len(x)]
