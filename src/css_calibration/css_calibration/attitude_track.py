# SPDX-License-Identifier: Apache-2.0
"""Attitude along a recording as unknowns: knots between which the measured rate is integrated.

Let Phi(t) be the rotation that the gyro counts from the beginning of a stretch on, and A(t) = Phi(t) E(t). With a gyro
bias b and white noise w, dE/dt = [(Phi^T (b + w)) x] E: E turns by the gyro's error alone, slowly. So E at knots a
minute apart, with the noise between them, and b, are unknowns; between the knots

    E(t) = R(u eps_k - (B(t) - B_k - u (B_k+1 - B_k)) b) E_k,   R(eps_k) = E_k+1 E_k^T,   B = integral of Phi^T,

u from 0 to 1, R(v) the rotation of the frame by v. The magnetometer reads M A B_n + h with a symmetric M.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

KNOT_S = 60.0
"""Time between knots [s]."""

BIAS, FIELD_BIAS, FIELD_SCALE, SOFT_IRON = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
"""Places among the common unknowns of a track."""
COMMON = 12
COMMON_SIGMA = np.repeat([np.radians(0.2), 20e-6, 0.2, 0.1], 3)
"""What is known before of gyro bias [rad/s], field bias [T], its scale and soft iron [-]."""
_KNOT_SIGMA = 1.0  # [rad]


def turn(vectors: np.ndarray) -> np.ndarray:
    """(K, 3, 3) rotations of the frame by vectors (K, 3) [rad]."""
    return Rotation.from_rotvec(-vectors).as_matrix()


def turned_by(matrices: np.ndarray) -> np.ndarray:
    """(K, 3) vectors by which rotations of the frame (K, 3, 3) turn [rad]."""
    return -Rotation.from_matrix(matrices).as_rotvec()


def crossing(v: np.ndarray) -> np.ndarray:
    """(K, 3, 3) matrices [v x]."""
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def soft_iron_matrix(common: np.ndarray) -> np.ndarray:
    """(3, 3) M of the common unknowns (12,)."""
    q = common[SOFT_IRON]
    matrix = np.diag(1.0 + common[FIELD_SCALE])
    for value, (i, j) in zip(q, ((0, 1), (0, 2), (1, 2)), strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


@dataclass
class Track:
    """Unknown attitudes.

    Attributes:
        phi: (M, 3, 3) what the gyro has counted at each instant since its stretch began.
        integral: (M, 3, 3) B at each instant.
        knot: (M,) knot before each instant, of those that follow.
        share: (M,) u of each.
        start: (K, 3, 3) E at each knot, first guess.
        knot_integral: (K, 3, 3) B there.
        linked: (K,) whether the next knot follows without a gap.
        link_sigma: (K,) what gyro noise turns E from a knot to the next [rad].
        sun_n, field_n: (M, 3) references.
        field_b: (M, 3) measured; NaN: not.
    """

    phi: np.ndarray
    integral: np.ndarray
    knot: np.ndarray
    share: np.ndarray
    start: np.ndarray
    knot_integral: np.ndarray
    linked: np.ndarray
    link_sigma: np.ndarray
    sun_n: np.ndarray
    field_n: np.ndarray
    field_b: np.ndarray
    field_sigma: float

    @property
    def count(self) -> int:
        """Number of unknowns: 12 in common, then three a knot."""
        return COMMON + 3 * len(self.start)

    def common(self, x: np.ndarray) -> np.ndarray:
        """(12,) in SI units of unknowns in units of what is known before."""
        return x[:COMMON] * COMMON_SIGMA

    def knots(self, x: np.ndarray) -> np.ndarray:
        """(K, 3, 3) E at the knots."""
        return turn(_KNOT_SIGMA * x[COMMON:].reshape(-1, 3)) @ self.start

    def _between(self) -> np.ndarray:
        """(M, 3, 3) what a gyro bias turns E beyond the share of its knots."""
        after = np.minimum(self.knot + 1, len(self.start) - 1)
        whole = self.knot_integral[after] - self.knot_integral[self.knot]
        return self.integral - self.knot_integral[self.knot] - self.share[:, None, None] * whole

    def attitudes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(M, 3, 3) dcm_bn, and E, at each instant."""
        knots = self.knots(x)
        step = np.zeros((len(knots), 3))
        step[:-1][self.linked[:-1]] = turned_by((knots[1:] @ knots[:-1].transpose(0, 2, 1))[self.linked[:-1]])
        bias = self.common(x)[BIAS]
        angles = self.share[:, None] * step[self.knot] - self._between() @ bias
        e = turn(angles) @ knots[self.knot]
        return self.phi @ e, e

    def by_unknowns(self, e: np.ndarray, reference: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(M, count) derivatives of weights (M, 3) . A reference by the unknowns.

        Args:
            e: (M, 3, 3) of `attitudes`.
            reference: (M, 3) vectors in n.
        """
        rows = np.arange(len(e))
        turned = np.einsum("kij,kj->ki", e, reference)
        # d(R(v) w) = w x v
        by_angle = np.einsum("ki,kij,kjl->kl", weights, self.phi, crossing(turned))
        out = np.zeros((len(e), self.count))
        out[:, BIAS] = -np.einsum("ki,kij->kj", by_angle, self._between()) * COMMON_SIGMA[BIAS]
        after = np.minimum(self.knot + 1, len(self.start) - 1)
        share = self.share * self.linked[self.knot]
        for j in range(3):
            np.add.at(out, (rows, COMMON + 3 * self.knot + j), (1.0 - share) * by_angle[:, j] * _KNOT_SIGMA)
            np.add.at(out, (rows, COMMON + 3 * after + j), share * by_angle[:, j] * _KNOT_SIGMA)
        return out

    def links(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (3 L,) of E from knot to knot in sigmas, and their derivatives (3 L, count)."""
        knots, bias = self.knots(x), self.common(x)[BIAS]
        first = np.flatnonzero(self.linked[:-1])
        step = turned_by(knots[first + 1] @ knots[first].transpose(0, 2, 1))
        whole = self.knot_integral[first + 1] - self.knot_integral[first]
        residuals = (step + whole @ bias) / self.link_sigma[first, None]
        out = np.zeros((len(first), 3, self.count))
        for j in range(3):
            by_knot = _KNOT_SIGMA / self.link_sigma[first]
            out[np.arange(len(first)), j, COMMON + 3 * first + j] = -by_knot
            out[np.arange(len(first)), j, COMMON + 3 * (first + 1) + j] = by_knot
        out[:, :, BIAS] = whole * COMMON_SIGMA[BIAS] / self.link_sigma[first, None, None]
        return residuals.ravel(), out.reshape(-1, self.count)

    def field(self, x: np.ndarray, dcm_bn: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (3 F,) of the field in sigmas, and their derivatives (3 F, count), where it was measured."""
        rows = np.flatnonzero(np.isfinite(self.field_b).all(axis=1))
        common = self.common(x)
        matrix = soft_iron_matrix(common)
        true_b = np.einsum("kij,kj->ki", dcm_bn[rows], self.field_n[rows])
        residuals = (true_b @ matrix.T + common[FIELD_BIAS] - self.field_b[rows]) / self.field_sigma
        out = np.zeros((len(rows), 3, self.count))
        part = self._rows(rows)
        for j in range(3):
            out[:, j] = part.by_unknowns(e[rows], self.field_n[rows], np.tile(matrix[j], (len(rows), 1)))
            out[:, j, FIELD_BIAS.start + j] = COMMON_SIGMA[FIELD_BIAS][j]
            out[:, j, FIELD_SCALE.start + j] = true_b[:, j] * COMMON_SIGMA[FIELD_SCALE][j]
        for place, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            out[:, i, SOFT_IRON.start + place] = true_b[:, j] * COMMON_SIGMA[SOFT_IRON][place]
            out[:, j, SOFT_IRON.start + place] = true_b[:, i] * COMMON_SIGMA[SOFT_IRON][place]
        return residuals.ravel(), out.reshape(-1, self.count) / self.field_sigma

    def _rows(self, rows: np.ndarray) -> "Track":
        """The same at some of the instants."""
        return Track(
            self.phi[rows], self.integral[rows], self.knot[rows], self.share[rows], self.start, self.knot_integral,
            self.linked, self.link_sigma, self.sun_n[rows], self.field_n[rows], self.field_b[rows], self.field_sigma,
        )  # fmt: skip
