# SPDX-License-Identifier: Apache-2.0
"""A body that tumbles without torque, what its sensors read, and the health of them driven through it."""

from functools import cache

import numpy as np
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.health import verdicts_of
from css_common.kernel import kernel
from css_estimation.health import aiding_health
from css_estimation.health.aiding_health import check_aiding
from css_estimation.health.gyroless_sight import glimpse_of
from css_estimation.health.sight import Sight
from css_estimation.sun.sun_heading import HELD_GYRO, LEFT_FIELD, LEFT_GYRO, UNKNOWN_SKY, Aiding

DEG = np.pi / 180.0
INERTIA = np.array([10.5, 8.0, 6.75])
SUN_N = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
ORBIT_RATE = 0.00113  # [rad/s]


def parameters(**changes):
    """Of the health of gyro and magnetometer."""
    return aiding_health.parameters(okeefe_values(aiding_health.PARAMETERS, **changes))


@cache
def tumble(rate_deg_s, count, dt):
    """Body rates (count, 3) [rad/s] and directions cosine matrices (count, 3, 3) of dcm_bn, by Euler's equations."""
    omega, dcm = np.array(rate_deg_s) * DEG, np.eye(3)
    rates, attitudes = np.zeros((count, 3)), np.zeros((count, 3, 3))

    def change(w):
        return -np.cross(w, INERTIA * w) / INERTIA

    for k in range(count):
        rates[k], attitudes[k] = omega, dcm
        k1 = change(omega)
        k2 = change(omega + 0.5 * dt * k1)
        dcm = np.array(rotation_vector_to_dcm(tuple((omega + 0.5 * dt * k1) * dt))) @ dcm
        omega = omega + dt * k2
    return rates, attitudes


def seen(attitudes, dice, sigma):
    """Directions to the Sun (N, 3) in b with white errors of so much [rad] per axis."""
    sun_b = attitudes @ SUN_N + sigma * dice.normal(size=(len(attitudes), 3))
    return sun_b / np.linalg.norm(sun_b, axis=1)[:, None]


def dipole(attitudes, dt):
    """Field (N, 3) [T] in b of a dipole, along a polar orbit."""
    angle = ORBIT_RATE * dt * np.arange(len(attitudes))
    place = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    axis = np.array([0.0, 0.0, 1.0])
    field_n = 3e-5 * (3.0 * place * (place @ axis)[:, None] - axis)
    return np.einsum("kij,kj->ki", attitudes, field_n), field_n


@kernel
def _drive(
    p, state, memory, dt, gyro, gyro_valid, field, field_valid, sun, variance, known, misfits, speeds, used, out
):
    for k in range(gyro.shape[0]):
        aiding = Aiding(
            (gyro[k, 0], gyro[k, 1], gyro[k, 2]),
            gyro_valid[k],
            (field[k, 0], field[k, 1], field[k, 2]),
            field_valid[k],
            speeds,
            False,
            UNKNOWN_SKY,
        )
        j = max(k - 1, 0)
        glimpse = glimpse_of(Sight((sun[j, 0], sun[j, 1], sun[j, 2]), variance, known[j]))
        state, trusted = check_aiding(p, state, memory, dt, aiding, glimpse, misfits, used[k])
        bias = state.gyro.opinion.bias
        for i in range(3):
            out[k, i], out[k, 3 + i] = trusted.gyro_b[i], bias.bias_b[i]
        out[k, 6], out[k, 7], out[k, 8] = bias.covariance[0], bias.covariance[3], bias.covariance[5]
        out[k, 9], out[k, 10], out[k, 11] = trusted.gyro_valid, trusted.field_valid, trusted.left
        out[k, 12], out[k, 13] = state.gyro.opinion.mode, bias.nis
    return state


class Judged:
    """What was made of all cycles: a row each."""

    def __init__(
        self, p, dt, *, gyro=None, field=None, sun, sigma, known=None, misfits=True, gyro_valid=None, used=None
    ):
        n = len(sun)
        yes, no, nothing = np.ones(n, bool), np.zeros(n, bool), np.zeros((n, 3))
        self.memory = aiding_health.initial_memory(p)
        out = np.zeros((n, 14))
        self.state = _drive(
            p,
            aiding_health.initial_state(p),
            self.memory,
            dt,
            nothing if gyro is None else gyro,
            (no if gyro is None else yes) if gyro_valid is None else gyro_valid,
            nothing if field is None else field,
            no if field is None else yes,
            sun,
            sigma**2,
            yes if known is None else known,
            misfits,
            np.zeros(0),
            yes if used is None else used,
            out,
        )
        self.rate_b, self.bias_b, self.variances = out[:, :3], out[:, 3:6], out[:, 6:9]
        self.gyro_valid, self.field_valid = out[:, 9] == 1.0, out[:, 10] == 1.0
        said = out[:, 11].astype(int)
        self.left, self.gyro_held = said & (LEFT_GYRO | LEFT_FIELD), (said & HELD_GYRO) != 0
        self.mode, self.nis = out[:, 12].astype(int), out[:, 13]

    @property
    def gyro_kinds(self):
        """Kinds by the axes that are held for failed at the end."""
        return {verdict.unit: verdict.kind for verdict in verdicts_of(self.memory.gyro_verdicts)}

    @property
    def field_kinds(self):
        """The same of the magnetometer."""
        return {verdict.unit: verdict.kind for verdict in verdicts_of(self.memory.field_verdicts)}
