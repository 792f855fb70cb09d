# SPDX-License-Identifier: Apache-2.0
"""Motor torques of redundant reaction wheels for a wanted body torque.

The minimum-norm solution through the pseudo-inverse of the wheel axes, for any number of wheels. Wheels out
of service get no torque; should the rest not span all directions, they give the nearest torque they can.
Beyond the torque limit all motors are scaled together, so that the torque keeps its direction, or each is
clipped.
"""

import math
from functools import reduce
from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import WHEEL_AXES, WHEEL_INERTIA, WHEEL_MAX_SPEED, WHEEL_MAX_TORQUE, of_each_wheel
from css_common.declared import builder, computed, made, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice, integers
from css_common.vectors import Vec3, dot, multiply, vector_of
from sunpoint_control.pseudo_inverse import NO_AXES, pseudo_inverse_of, with_axis

WHEELS_OUT = integers("wheels_out", (), "-", "indices of wheels out of service, from 0", low=0, high=31, tunable=True)

_FIELDS = ("gx", "gy", "gz", "mx", "my", "mz", "inertia", "max_torque", "max_speed")
_RPM = math.pi / 30.0  # [rad/s]

WHEEL = np.dtype([(name, np.float64) for name in _FIELDS], align=True)
"""One wheel: unit spin axis in b, and its row of the pseudo-inverse of Gs; zeros: out of service. Spin inertia
[kg m^2], largest torque [N m] and speed [rad/s]; 0 where nobody has said."""


def pseudo_inverse(axes_b: np.ndarray, out_of_service=()) -> np.ndarray:
    """Map (n, 3) from a torque in b to wheel torques of least norm, for (n, 3) axes."""
    axes = np.array(axes_b, dtype=np.float64)
    axes[list(out_of_service)] = 0.0
    of_axes = reduce(with_axis, map(vector_of, axes), NO_AXES)
    inverse, _ = pseudo_inverse_of(of_axes)
    return np.array([multiply(inverse, vector_of(axis)) for axis in axes]).reshape(-1, 3)


def _wheels(values: Values) -> np.ndarray:
    axes_b = values[WHEEL_AXES]
    wheels = np.zeros(len(axes_b), WHEEL)
    wheels["gx"], wheels["gy"], wheels["gz"] = axes_b.T
    wheels["mx"], wheels["my"], wheels["mz"] = pseudo_inverse(axes_b, values[WHEELS_OUT]).T
    # asked for where wheels are fitted
    wheels["inertia"] = np.nan_to_num(of_each_wheel(values, WHEEL_INERTIA))
    wheels["max_torque"] = np.nan_to_num(of_each_wheel(values, WHEEL_MAX_TORQUE))
    wheels["max_speed"] = np.nan_to_num(of_each_wheel(values, WHEEL_MAX_SPEED)) * _RPM
    return wheels


class AllocationParameters(NamedTuple):
    """The mission's `wheels`, and how they share a torque."""

    keep_direction: bool = made(
        lambda word: word == "scale",
        choice(
            "wheel_saturation",
            "scale",
            ("scale", "clip"),
            "beyond the torque limit: scale all wheels, or clip each",
            tunable=True,
        ),
    )
    # (n,) of WHEEL: one array, because each one in a parameter costs time at every call
    wheels: np.ndarray = computed(_wheels, WHEELS_OUT)


PARAMETERS = table_of(AllocationParameters)
parameters = builder(AllocationParameters)


@kernel
def spin_axis(wheel) -> Vec3:
    """Unit spin axis in b of one `WHEEL`."""
    return (wheel.gx, wheel.gy, wheel.gz)


@kernel
def least_torque(wheel, torque_b: Vec3) -> float:
    """Share of one `WHEEL` in the least wheel torques u with Gs u = torque_b."""
    return wheel.mx * torque_b[0] + wheel.my * torque_b[1] + wheel.mz * torque_b[2]


@kernel
def allocate(p: AllocationParameters, torque_b: Vec3, out) -> None:
    """Writes the motor torques (n,) [N m] with the reaction `torque_b` [N m] on the body, -Gs u."""
    for i in range(out.shape[0]):
        out[i] = -least_torque(p.wheels[i], torque_b)


@kernel
def limit_torques(p: AllocationParameters, torques) -> int:
    """Brings motor torques (n,) [N m] within their limits, in place; mask of the wheels above theirs."""
    mask = 0
    k = 1.0
    for i in range(torques.shape[0]):
        size, limit = abs(torques[i]), p.wheels[i].max_torque
        if size > limit:
            mask |= 1 << i
            k = min(k, limit / size)
    if mask == 0:
        return mask
    for i in range(torques.shape[0]):
        limit = p.wheels[i].max_torque
        torques[i] = k * torques[i] if p.keep_direction else min(max(torques[i], -limit), limit)
    return mask


@kernel
def wheel_momentum(wheels, speeds, omega_bn_b: Vec3) -> Vec3:
    """Gs h_s [N m s], h_i = Js (Omega_i + g_i . omega): momentum of the wheels about their spin axes, in b.

    Args:
        wheels: (n,) of `WHEEL`.
        speeds: (n,) speeds relative to the body [rad/s].
    """
    x = y = z = 0.0
    for i in range(wheels.shape[0]):
        g = spin_axis(wheels[i])
        h = wheels[i].inertia * (speeds[i] + dot(g, omega_bn_b))
        x += h * g[0]
        y += h * g[1]
        z += h * g[2]
    return (x, y, z)
