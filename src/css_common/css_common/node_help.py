# SPDX-License-Identifier: Apache-2.0
"""What `ros2 run PACKAGE NODE --help` prints: topics with what is expected of messages, parameters, exit codes."""

from collections.abc import Iterator

from rclpy.qos import QoSProfile

from css_common.codec import type_name
from css_common.component import INERTIAL, Component, Input, Output
from css_common.qos import LOOP_PUBLISHER, LOOP_SUBSCRIPTION
from css_common.schema import Parameter, Values, default_values

OVERRIDABLE = ("history", "depth", "reliability", "durability")
"""Policies of the quality of service that a parameter can change."""

_MOST_SHOWN = 6
_EXIT_CODES = (
    "Exit code: 0 told to end, or the flight is over; 1 it failed; 2 something given is wrong",
    "(arguments, parameters, files, names).",
)


def describe(component_type: type[Component]) -> str:
    """Help text of a node: purpose, topics, parameters with unit, range and default, exit codes."""
    package, _, name = component_type.__module__.partition(".nodes.")
    values = default_values(component_type.table())
    inputs, outputs = component_type.inputs(name, values), component_type.outputs(name, values)
    lines = [f"ros2 run {package} {name} [--ros-args --params-file MISSION.yaml ...]", ""]
    lines += [(component_type.__doc__ or "").strip(), "", "Subscribes:"]
    heard = [line for port in inputs for line in _topic(port, values, LOOP_SUBSCRIPTION, "subscription")]
    lines += heard or ["  nothing"]
    lines += ["", "Publishes:"]
    lines += [line for port in outputs for line in _topic(port, values, LOOP_PUBLISHER, "publisher")]
    lines += ["  /diagnostics  diagnostic_msgs/msg/DiagnosticArray", "", *_examples(component_type, inputs, outputs)]
    lines += ["", "Parameters (* may change in flight; numbers without [unit] have none):"]
    lines += [line for parameter in component_type.table() for line in _parameter(parameter)]
    return "\n".join([*lines, "", *_EXIT_CODES])


def _topic(port: Input | Output, values: Values, profile: QoSProfile, end: str) -> Iterator[str]:
    optional = isinstance(port, Input) and not port.required
    yield f"  {port.topic}  {type_name(port.message_type)}" + ("  (optional)" if optional else "")
    key = "inertial_frame" if port.frame == INERTIAL else "body_frame"
    further = "; further ones: io.accepted_frames" if isinstance(port, Input) else ""
    yield f"      frame_id: {getattr(values.io, key)} (io.{key}{further})"
    policies = (profile.reliability, profile.durability)
    adapts = ", less where the first writer offers less" if isinstance(port, Input) else ""
    words = ", ".join(policy.name.lower() for policy in policies)
    yield f"      QoS: {words}, keep last {profile.depth}{adapts}; overrides:"
    yield f"      qos_overrides./{port.topic}.{end}.{{{','.join(OVERRIDABLE)}}}"


def _examples(component_type: type[Component], inputs: tuple[Input, ...], outputs: tuple[Output, ...]) -> Iterator[str]:
    package, _, name = component_type.__module__.partition(".nodes.")
    end, port = ("subscription", inputs[0]) if inputs else ("publisher", outputs[0])
    override = f"qos_overrides./my/topic.{end}.reliability:=best_effort"
    tunable = next((p for p in component_type.table() if p.tunable and not p.is_array), None)
    yield "Examples:"
    yield f"  ros2 run {package} {name} --ros-args --params-file config/okeefe_2013.yaml"
    yield f"  ros2 run {package} {name} --ros-args -r {port.topic}:=my/topic -p {override}"
    if tunable is not None:
        yield f"  ros2 param set /{name} {tunable.name} {_shown(tunable)}"


def _parameter(p: Parameter) -> Iterator[str]:
    yield f"  {'*' if p.tunable else ' '}{p.name} = {_shown(p)}"
    yield f"      {p.description}; {p.expectation()}" + (f"; for instance {p.example}" if p.example else "")


def _shown(p: Parameter) -> str:
    if p.is_array and len(p.default) > _MOST_SHOWN:
        return f"{len(p.default)} values"
    if p.default != p.default:
        return "none"
    return {True: "true", False: "false"}[p.default] if p.kind == "flag" else str(p.default)
