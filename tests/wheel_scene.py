# SPDX-License-Identifier: Apache-2.0
"""A body with wheels that may fail, flown by the control on the true Sun: for tests of what the control finds."""

import math

import numpy as np
from okeefe_spacecraft import okeefe_values

from css_common.actuator_sections import RODS, WHEELS
from css_common.attitude import mrp_rate, mrp_shadow, mrp_to_dcm
from css_common.health import SORT_WHEEL, verdicts_of
from css_common.sections import SPACECRAFT
from css_common.vectors import angle_between, multiply
from sunpoint_control import sun_pointing_control as control
from sunpoint_control.held_field import HeldField

TABLE = SPACECRAFT + WHEELS + RODS + control.PARAMETERS
AXES = np.asarray(okeefe_values(WHEELS).wheels.axes)
INERTIA = np.diag((10.5, 8.0, 6.75))
JS, LIMIT = 0.001, 0.030
DT = 0.1
RPM = math.pi / 30.0
SUN_N = (0.36, 0.48, 0.8)
GYRO, NO_RATE, SUN_RATE = 1, 0, 2


class Scene:
    """A flight, one cycle after the other.

    Attributes:
        motor: what each wheel makes of its command [N m], with its speed [rad/s] and the time [s]; by wheel.
        reading: what its tachometer makes of its speed; by wheel.
        friction: Coulomb friction [N m] of each wheel.
        wear: what is added to it, with the time [s]; by wheel.
        noise: 1 sigma of all tachometers [rad/s].
        told: sort, unit and kind of what was held for failed, with the time [s], whenever that changed.
    """

    def __init__(self, seed=0, rate_deg_s=2.0, source=GYRO, rate_noise_deg_s=0.01, **changes):
        self.p = control.parameters(okeefe_values(TABLE, **{"health__rate_cutoff": 0.0, **changes}))
        self.state, self.memory = control.initial_state(self.p), control.initial_memory(self.p)
        self.rng = np.random.default_rng(seed)
        self.sigma = mrp_shadow(tuple(self.rng.uniform(-0.8, 0.8, 3).tolist()))
        self.omega = np.radians(self.rng.uniform(-rate_deg_s, rate_deg_s, 3))
        self.momenta = JS * AXES @ self.omega  # at rest relative to the body
        self.source, self.rate_noise = source, math.radians(rate_noise_deg_s)
        self.motor, self.reading, self.wear = {}, {}, {}
        self.friction, self.noise = np.zeros(4), 0.0
        self.torques, self.dipoles = np.zeros(4), np.zeros(3)
        self.time, self.told = 0.0, []
        self.valid = 2

    @property
    def speeds(self):
        """True speeds [rad/s] relative to the body."""
        return self.momenta / JS - AXES @ self.omega

    @property
    def sun_b(self):
        """True Sun in b."""
        return multiply(mrp_to_dcm(self.sigma), SUN_N)

    @property
    def error_deg(self):
        """True angle [deg] from the array normal to the Sun."""
        return math.degrees(angle_between(self.sun_b, (0.0, 0.0, 1.0)))

    def cycle(self):
        """One control cycle, and what the control decided in it."""
        speeds = self.speeds
        read = speeds + self.noise * self.rng.standard_normal(4)
        for i, reading in self.reading.items():
            read[i] = reading(read[i], self.time)
        omega = tuple((self.omega + self.rate_noise * self.rng.standard_normal(3)).tolist())
        self.state, output = control.step(
            self.p, self.state, self.memory, DT, self.sun_b, self.valid, 0, omega, self.source, read,
            HeldField((0.0, 0.0, 0.0), False, False), self.torques, self.dipoles,
        )  # fmt: skip
        held = {(v.sort, v.unit, v.kind) for v in verdicts_of(self.memory.verdicts)}
        if held != (self.told[-1][1] if self.told else set()):
            self.told.append((self.time, held))
        self._move(speeds)
        return output

    def fly(self, seconds):
        """Cycles for so long; what was decided in the last."""
        for _ in range(round(seconds / DT)):
            output = self.cycle()
        return output

    def turn_away_and_back(self):
        """Reaches the Sun, is found in another attitude, and reaches it again; what was decided in the last cycle."""
        self.fly(60.0)
        self.sigma = (-0.5, 0.4, 0.3)
        return self.fly(240.0)

    def _move(self, speeds):
        motors = self.torques.copy()
        for i, motor in self.motor.items():
            motors[i] = motor(motors[i], speeds[i], self.time)
        torques = np.clip(motors, -LIMIT, LIMIT)
        # friction brings a wheel to rest, and turns none
        friction = self.friction + [self.wear[i](self.time) if i in self.wear else 0.0 for i in range(4)]
        torques -= np.clip(torques + speeds * JS / DT, -friction, friction)

        def derivative(sigma, omega, h):
            turning = -np.cross(omega, INERTIA @ omega + AXES.T @ h) - AXES.T @ torques
            return np.array(mrp_rate(tuple(sigma), tuple(omega))), np.linalg.solve(INERTIA, turning)

        s, w, h = np.array(self.sigma), self.omega, self.momenta
        a = derivative(s, w, h)
        b = derivative(s + DT / 2 * a[0], w + DT / 2 * a[1], h + DT / 2 * torques)
        c = derivative(s + DT / 2 * b[0], w + DT / 2 * b[1], h + DT / 2 * torques)
        d = derivative(s + DT * c[0], w + DT * c[1], h + DT * torques)
        self.sigma = mrp_shadow(tuple((s + DT / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])).tolist()))
        self.omega = w + DT / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        self.momenta = h + DT * torques
        self.time += DT

    def held(self, sort=SORT_WHEEL):
        """Units of a sort that are held for failed now, and their kinds."""
        return {v.unit: v.kind for v in verdicts_of(self.memory.verdicts) if v.sort == sort}
