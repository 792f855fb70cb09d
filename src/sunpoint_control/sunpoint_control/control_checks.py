# SPDX-License-Identifier: Apache-2.0
"""Checks of the control before a flight: gains that cannot be stable, wheels that cannot turn the body."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from css_common.actuator_sections import WHEEL_INERTIA, WHEEL_MAX_SPEED, WHEEL_MAX_TORQUE, of_each_wheel
from css_common.component import Finding, Plant, Smoothing
from css_common.mission_node import Node
from css_common.schema import Values
from css_common.sensor_inputs import measures_rates
from sunpoint_control.loop_stability import Gains, LoopModel, gain_findings
from sunpoint_control.wheel_allocation import pseudo_inverse

_ALIKE = 0.01  # relative difference of two low-passes that are one
_FARTHEST_TURN = 0.5  # [rad] of a reference that spins, between two cycles


def control_findings(node: Node, graph: Mapping[str, Node]) -> Iterator[Finding]:
    """What the gains and wheels of a control node do in a mission's graph."""
    values = node.values
    model = loop_model(values, graph)
    if not np.any(of_each_wheel(values, WHEEL_MAX_TORQUE)):
        yield Finding("wheels.max_torque: 0 given, expected a torque above 0: the wheels cannot turn the body")
    turned = np.linalg.matrix_rank(model.authority, tol=1e-6)
    if turned < 3:
        yield Finding(f"wheels_out: the wheels that are left turn the body about {turned} of 3 axes, expected all")
    speeds = pseudo_inverse(np.asarray(values.wheels.axes), values.wheels_out) @ values.dumping.momentum
    rpm = np.abs(speeds) / of_each_wheel(values, WHEEL_INERTIA) * 30.0 / np.pi
    limits = of_each_wheel(values, WHEEL_MAX_SPEED)
    worst = int(np.argmax(rpm - limits))
    fastest = float(rpm[worst])
    if values.dumping.enabled and fastest > limits[worst]:
        yield Finding(
            f"dumping.momentum: takes {fastest:.0f} rpm of a wheel, expected at most wheels.max_speed_rpm "
            f"{limits[worst]:g}"
        )
    yield from _dumping_findings(values)
    turned_in_cycle = abs(values.reference.spin_deg_s) * model.period
    if turned_in_cycle > math.degrees(_FARTHEST_TURN):
        yield Finding(
            f"reference.spin_deg_s: {values.reference.spin_deg_s:g} given, {turned_in_cycle:.0f} deg in a cycle of "
            f"{model.period:g} s, expected at most {math.degrees(_FARTHEST_TURN) / model.period:.3g}: what samples "
            "once a cycle cannot follow"
        )
    yield from _low_pass_finding(values, model)
    gains = Gains(values.gains.k, values.gains.p, values.gains.ki)
    yield from gain_findings(model, gains, _setting(values, model))


def _dumping_findings(values: Values) -> Iterator[Finding]:
    """Speeds go as Omega_k+1 = (1 - c h) Omega_k: they ring from c h = 1 on, and grow beyond 2."""
    share = values.dumping.gain * values.mission.period
    if not values.dumping.enabled or not values.rods.fitted or share < 1.0:
        return
    most = 1.0 / values.mission.period
    yield Finding(
        f"dumping.gain: {values.dumping.gain:g} given, {share:.3g} of a wheel's momentum in a cycle of "
        f"{values.mission.period:g} s, expected less than {most:.3g}: "
        + ("the speeds grow" if share > 2.0 else "the speeds ring"),
        refused=share > 2.0,
    )


def _low_pass_finding(values: Values, model: LoopModel) -> Iterator[Finding]:
    """A low-pass on the rate that is not the one which wheel health reckons with."""
    if not values.health.enabled or not model.gyro:
        return
    cutoff, gain, period = values.health.rate_cutoff, model.smoothing.rate, model.period
    reckoned = -math.expm1(-2.0 * math.pi * cutoff * period) if cutoff > 0.0 else 1.0
    if abs(reckoned - gain) > _ALIKE * gain:
        right = -math.log1p(-gain) / (2.0 * math.pi * period) if gain < 1.0 else 0.0
        yield Finding(
            f"health.rate_cutoff: {cutoff:g} Hz given, expected {right:.3g}, that of {values.graph.estimator}: the "
            "turning of the body could not tell a wheel from its tachometer"
        )


def loop_model(values: Values, graph: Mapping[str, Node]) -> LoopModel:
    """The loop around a control with these values, as the graph closes it."""
    estimator = graph.get(values.graph.estimator)
    use_gyro = bool(estimator is None or getattr(estimator.values, "use_gyro", True))
    measured = not graph or measures_rates(graph.values())
    simulated = any(issubclass(other.component, Plant) for other in graph.values())
    axes = np.asarray(values.wheels.axes)
    return LoopModel(
        inertia=np.asarray(values.spacecraft.inertia),
        array_normal_b=np.asarray(values.spacecraft.array_normal),
        authority=axes.T @ pseudo_inverse(axes, values.wheels_out),
        period=values.mission.period,
        smoothing=estimator.component.smoothing(estimator.values) if estimator else Smoothing(),
        gyro=use_gyro and (measured or not simulated),
        late=not simulated or values.io.input_matching != "exact",
    )


def _setting(values: Values, model: LoopModel) -> str:
    """What else the limits hang on."""
    gains = values.gains
    source = "gyro" if model.gyro else "no gyro"
    return (
        f"with k {gains.k:g}, p {gains.p:g}, ki {gains.ki:g}, spacecraft.inertia, mission.period {model.period:g} s, "
        f"{source} and the smoothing of {values.graph.estimator}"
    )
