# SPDX-License-Identifier: Apache-2.0
"""Friction in the bearings of reaction wheels: Coulomb and viscous, between wheel and body.

    f = -c_C sign(W) - c_V W

with the wheel's speed W relative to the body, as the reaction wheels of Basilisk have it (`reactionWheelStateEffector`,
fCoulomb and cViscous; its Stribeck term is left out). It acts on the wheel and, turned round, on the body: their total
momentum does not know of it. A wheel that friction alone can hold stays where it is.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, given, table_of
from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, normal4
from css_common.schema import real


class Friction(NamedTuple):
    """Of all wheels, and how cases differ in it."""

    coulomb: float = given(
        real("friction.coulomb", 0.0, "N m", "friction of a wheel that turns, whatever its speed", low=0.0, high=1.0)
    )
    viscous: float = given(
        real("friction.viscous", 0.0, "N m s", "friction of a wheel per rad/s of its speed", low=0.0, high=1.0)
    )
    spread: float = given(
        real("dispersion.friction", 0.0, "-", "1 sigma of each wheel's friction, relative", low=0.0, high=1.0)
    )


PARAMETERS = table_of(Friction)
parameters = builder(Friction)


def dispersed_friction(p: Friction, key: RandomKey, wheels: int) -> tuple[np.ndarray, np.ndarray]:
    """Coulomb [N m] and viscous [N m s] friction of each wheel (N,) of a case: both by the same draw, never below 0."""
    draws = np.array([normal4(key, Stream.WHEEL_FRICTION, 0, i)[0] for i in range(wheels)])
    factor = np.clip(1.0 + p.spread * draws, 0.0, None)
    return p.coulomb * factor, p.viscous * factor


@kernel
def shaft_torque(coulomb: float, viscous: float, motor: float, speed: float, response: float, dt: float) -> float:
    """Mean torque [N m] of motor and friction on a wheel over a step.

    Exact for one wheel whose motor torque is held: viscous friction as the exponential that it makes, Coulomb friction
    as much as is there, but no more than brings the wheel to rest at the end of the step.

    Args:
        motor: torque of the motor on the wheel [N m].
        speed: of the wheel relative to the body at the start of the step [rad/s].
        response: change of that speed [rad/s^2] by a torque of 1 N m between wheel and body.
        dt: length of the step [s].
    """
    decay = viscous * response * dt
    held = -math.expm1(-decay) / decay if decay > 1e-9 else 1.0 - 0.5 * decay
    torque = held * (motor - viscous * speed)
    stopping = torque + speed / (response * dt)
    limit = held * coulomb
    return torque - min(max(stopping, -limit), limit)
