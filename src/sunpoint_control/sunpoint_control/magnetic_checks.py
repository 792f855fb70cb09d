# SPDX-License-Identifier: Apache-2.0
"""Checks of the control with torque rods before a flight: a field to act on, and a body that its samples can follow."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from css_common.actuator_sections import rod_max_dipoles
from css_common.component import Finding, Plant
from css_common.mission_node import Node
from sunpoint_control.magnetic_control import parameters

_LARGEST_LAG = math.radians(60.0)  # half of the damping is left
_LARGEST_TILT = math.radians(15.0)  # principal axis to array normal
_LEAST_RATIO = 1.05  # of the moments about and across the spin axis
_LARGEST_STEP = 0.2  # share of the rate that one command may take away
# With the mean rate of the last interval taken for that of now, omega_k+1 = omega_k - s (omega_k + omega_k-1) / 2: the
# roots of z^2 - (1 - s/2) z + s/2 leave the unit circle where their product s/2 is above 1.
_UNSTABLE_STEP = 2.0


def magnetic_findings(node: Node, graph: Mapping[str, Node]) -> Iterator[Finding]:
    """What is wrong with rods, field and gains of a magnetic control in a mission's graph."""
    values = node.values
    if not np.any(rod_max_dipoles(values)):
        yield Finding("rods.max_dipole: 0 given, expected a dipole above 0: the rods cannot turn the body")
    simulated = any(issubclass(other.component, Plant) for other in graph.values())
    measured = any(output.topic == "mag/field" for other in graph.values() for output in other.outputs)
    if simulated and not measured:
        yield Finding("no node of graph.nodes publishes mag/field: the rods will rest")
    sun = f"{values.graph.estimator}/sun_estimate"
    if values.magnetometer.divider > 1 and not any(o.topic == sun for other in graph.values() for o in other.outputs):
        yield Finding(
            f"magnetometer.divider: {values.magnetometer.divider} given, but nothing comes in the cycles between two "
            f"measurements, as no node of graph.nodes publishes {sun}: expected 1",
            refused=simulated,
        )
    p, interval = parameters(values), values.magnetometer.divider * values.mission.period
    if interval > p.motion.longest_gap:
        yield Finding(
            f"field.longest_gap: {p.motion.longest_gap:g} given, but the field is measured every {interval:g} s: no "
            "two measurements make a derivative, and the rods will rest"
        )
    moments, axes = np.linalg.eigh(values.spacecraft.inertia)
    if not p.detumble_only:
        yield from _spin_axis_findings(moments, axes, values.spacecraft.array_normal)
    share = max(p.spin.damping_gain, p.spin.spin_gain) * interval / moments[0]
    if share > _LARGEST_STEP:
        yield Finding(
            f"gains: {max(p.spin.damping_gain, p.spin.spin_gain):.3g} N m s held for {interval:g} s takes "
            f"{share:.2g} of the body rate at a time, expected at most {_LARGEST_STEP:g}"
            + (f": from {_UNSTABLE_STEP:g} on the rate grows" if share >= _UNSTABLE_STEP else ""),
            refused=share >= _UNSTABLE_STEP,
        )
    yield from _lag_findings(interval, graph)


def _spin_axis_findings(moments: np.ndarray, axes: np.ndarray, normal_b: np.ndarray) -> Iterator[Finding]:
    """A body spins well about the axis of its largest moment of inertia, and the better the larger that one is."""
    tilt = math.acos(min(1.0, abs(float(axes[:, 2] @ normal_b))))
    if tilt > _LARGEST_TILT:
        yield Finding(
            f"spacecraft.array_normal: {math.degrees(tilt):.0f} deg from the axis of the largest moment of inertia, "
            f"expected at most {math.degrees(_LARGEST_TILT):.0f}: the body does not keep a spin about it"
        )
    elif moments[2] < _LEAST_RATIO * moments[1]:
        yield Finding(
            f"spacecraft.inertia: the largest moment is {moments[2] / moments[1]:.3g} times the next, expected at "
            f"least {_LEAST_RATIO:g}: next to nothing holds the spin axis in the body"
        )


def _lag_findings(interval: float, graph: Mapping[str, Node]) -> Iterator[Finding]:
    """The derivative is that of half an interval ago, and held for an interval."""
    for other in graph.values():
        rate = other.component.fastest_start(other.values) if issubclass(other.component, Plant) else 0.0
        if rate * interval > _LARGEST_LAG:
            yield Finding(
                f"magnetometer.divider: a measurement every {interval:g} s, in which the body turns by up to "
                f"{math.degrees(rate * interval):.0f} deg, expected at most {math.degrees(_LARGEST_LAG):.0f}: the "
                "dipoles lag behind the field"
            )
