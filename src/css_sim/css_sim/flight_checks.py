# SPDX-License-Identifier: Apache-2.0
"""Checks of the simulated spacecraft before a flight, and of its motion during one."""

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np

from css_common.actuator_sections import (
    RODS_FITTED,
    WHEEL_INERTIA,
    WHEEL_MAX_SPEED,
    WHEEL_MAX_TORQUE,
    WHEELS_FITTED,
    of_each_wheel,
    rod_max_dipoles,
    wheel_axes,
)
from css_common.component import Finding
from css_common.mission_node import Node
from css_common.mission_section import DURATION, PERIOD
from css_common.orbit_section import ALTITUDE, ECCENTRICITY, ORBIT_SOURCE
from css_common.schema import Values
from css_common.sections import INERTIA
from css_common.vectors import Vec3
from css_environment.constants import EARTH_MU, EARTH_RADIUS
from css_environment.orbit_checks import field_findings, orbit_findings
from css_sim import initial_conditions
from css_sim.disturbances import DIPOLE, GRAVITY_GRADIENT, TORQUE
from css_sim.flight_environment import GEOMAGNETIC_FIELD
from css_sim.initial_conditions import FIXED_RATE, MAX_RATE, RATE, WHEEL_SPEEDS, has_dipole

FASTEST = 200.0
"""Body rate [rad/s] beyond which a flight ends: nothing that carries sun sensors holds together there."""

_FARTHEST_TURN = 0.5  # [rad] of the body between two cycles
_NEARLY_FULL = 0.95  # of the wheels' speed limit
_PUMPED = 0.1  # growth of the amplitude of a swing over the flight by the step of the torques alone
_FIELD_AT_GROUND = 6.2e-5  # [T] largest at the surface
_RADIANS_PER_RPM = 2.0 * math.pi / 60.0


class MotionError(Exception):
    """The body moves as no spacecraft does, with rate and what may be wrong."""


def check_rate(omega_bn_b: Vec3) -> None:
    """Ends a flight whose body rate [rad/s] is beyond all reason or no number.

    Raises:
        MotionError: naming the rate.
    """
    x, y, z = omega_bn_b
    square = x * x + y * y + z * z
    if not square <= FASTEST * FASTEST:
        raise MotionError(
            f"the body turns at {math.degrees(math.sqrt(square)):.6g} deg/s, expected at most "
            f"{math.degrees(FASTEST):.0f}: look at the control's gains, the torques and mission.period"
        )


def plant_findings(node: Node, graph: Mapping[str, Node]) -> Iterator[Finding]:
    """What is wrong with orbit, environment and motion of a simulated spacecraft."""
    values = node.values
    yield from orbit_findings(values)
    if values[GEOMAGNETIC_FIELD] and _field_matters(values, graph):
        yield from field_findings(values)
    yield from _rate_findings(values)
    yield from _swing_findings(values)
    yield from _torque_findings(values)
    if values[WHEELS_FITTED]:
        controlled = any(
            output.topic == "wheels/torque_command" for other in graph.values() for output in other.outputs
        )
        yield from _wheel_findings(values, controlled)


def _field_matters(values: Values, graph: Mapping[str, Node]) -> bool:
    measured = any(output.topic == "mag/field" for other in graph.values() for output in other.outputs)
    return measured or values[RODS_FITTED] or has_dipole(values)


def _first_rates(values: Values) -> tuple[str, np.ndarray]:
    """The key of the first body rate, and the largest rate about each axis [rad/s]."""
    start = initial_conditions.parameters(values)
    if start.random_rate:
        return MAX_RATE.name, np.full(3, start.max_rate)
    if start.random_direction:
        return RATE.name, np.full(3, start.rate)
    return FIXED_RATE.name, np.abs(start.omega_bn_b)


def fastest_start(values: Values) -> float:
    """Largest norm [rad/s] of the body rate at the epoch."""
    start = initial_conditions.parameters(values)
    if start.random_direction:
        return start.rate
    return float(np.linalg.norm(_first_rates(values)[1]))


def _rate_findings(values: Values) -> Iterator[Finding]:
    key, _ = _first_rates(values)
    fastest, period = fastest_start(values), values[PERIOD]
    if fastest > FASTEST:
        yield Finding(
            f"{key}: up to {math.degrees(fastest):.0f} deg/s given, expected at most {math.degrees(FASTEST):.0f}",
            refused=True,
        )
    elif fastest * period > _FARTHEST_TURN:
        yield Finding(
            f"mission.period: {period:g} given, in which the body turns by up to {math.degrees(fastest * period):.0f} "
            f"deg at {key}, expected at most {_FARTHEST_TURN / fastest:.3g} s: what samples once a cycle cannot follow"
        )


def _swing_findings(values: Values) -> Iterator[Finding]:
    """Torques held over a cycle h pump the swing that they make: it grows by (its angular frequency)^2 h/4 a second."""
    smallest, _, largest = np.linalg.eigvalsh(values[INERTIA])
    perigee = EARTH_RADIUS
    if values[ORBIT_SOURCE] == "elements":
        perigee = (EARTH_RADIUS + values[ALTITUDE]) * (1.0 - values[ECCENTRICITY])
    field = _FIELD_AT_GROUND * (EARTH_RADIUS / perigee) ** 3
    gravity = values[GRAVITY_GRADIENT]
    dipole = np.abs(values[DIPOLE]) + initial_conditions.dispersion(values).dipole
    squares = {
        "disturbances.dipole": float(np.linalg.norm(dipole)) * field / smallest,
        "disturbances.gravity_gradient": 3.0 * EARTH_MU / perigee**3 * (largest - smallest) / smallest * gravity,
    }
    period, duration = values[PERIOD], values[DURATION]
    for key, square in squares.items():
        growth = 0.25 * square * period * duration
        if growth > _PUMPED:
            yield Finding(
                f"mission.period: {period:g} given, over which the torque of {key} is held: that alone lets a "
                f"swing about it grow by up to a factor of {math.exp(min(growth, 700.0)):.3g} in the flight, expected "
                f"at most {period * _PUMPED / growth:.2g} s"
            )


def _torque_findings(values: Values) -> Iterator[Finding]:
    """Torques that within one cycle, in which nobody commands another, turn the body as no spacecraft turns."""
    period, smallest = values[PERIOD], float(np.linalg.eigvalsh(values[INERTIA])[0])
    torques = {"disturbances.torque": float(np.linalg.norm(values[TORQUE]))}
    if values[WHEELS_FITTED]:
        most = wheel_axes(values) * of_each_wheel(values, WHEEL_MAX_TORQUE)[:, None]
        # no sum of them with any signs is larger
        torques["wheels.max_torque"] = float(np.linalg.norm(most, 2)) * math.sqrt(len(most))
    if values[RODS_FITTED]:
        torques["rods.max_dipole"] = float(np.sum(rod_max_dipoles(values))) * _FIELD_AT_GROUND
    for key, torque in torques.items():
        faster = torque / smallest * period
        if faster > FASTEST or 0.5 * faster * period > _FARTHEST_TURN:
            shown = f"{math.degrees(faster):.3g} deg/s" if faster < math.inf else "without bound"
            yield Finding(
                f"{key}: up to {torque:.3g} N m given, which in a cycle of {period:g} s makes a body of "
                f"{smallest:.3g} kg m^2 faster by {shown}, expected at most "
                f"{min(FASTEST, 2.0 * _FARTHEST_TURN / period) * smallest / period:.3g} N m",
                refused=faster > FASTEST,
            )


def _wheel_findings(values: Values, controlled: bool) -> Iterator[Finding]:
    limit, given = float(np.min(of_each_wheel(values, WHEEL_MAX_SPEED))), values[WHEEL_SPEEDS]
    first = float(np.max(np.abs(given), initial=0.0))
    needed = first + _needed_speed_rpm(values)
    if first >= _NEARLY_FULL * limit:
        yield Finding(
            f"initial.wheel_speed_rpm: {first:g} given, expected less than {_NEARLY_FULL * limit:g}: the wheels begin "
            f"at their limit of {limit:g} and cannot take momentum up"
        )
    elif controlled and needed > limit:
        yield Finding(
            f"wheels.max_speed_rpm: {limit:g} given, expected at least {needed:.0f}: the wheels cannot take up the "
            "momentum that the body may begin with"
        )


def _needed_speed_rpm(values: Values) -> float:
    """Largest speed of a wheel when all have taken up the body's first momentum, over the signs of its rates."""
    _, rates = _first_rates(values)
    share = np.linalg.pinv(wheel_axes(values).T) @ values[INERTIA]
    inertias = of_each_wheel(values, WHEEL_INERTIA)
    speeds = [np.max(np.abs(share @ (rates * signs)) / inertias) for signs in itertools.product((1.0, -1.0), repeat=3)]
    return float(max(speeds)) / _RADIANS_PER_RPM
