# SPDX-License-Identifier: Apache-2.0
"""Declaration of a parameter table on a ROS node, and refusal of bad values in flight."""

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from css_common.ros_internals import overrides_of
from css_common.schema import Parameter, ParameterError, integer

_TYPES = {
    "real": RosParameter.Type.DOUBLE,
    "integer": RosParameter.Type.INTEGER,
    "flag": RosParameter.Type.BOOL,
    "choice": RosParameter.Type.STRING,
    "text": RosParameter.Type.STRING,
    "reals": RosParameter.Type.DOUBLE_ARRAY,
    "integers": RosParameter.Type.INTEGER_ARRAY,
    "texts": RosParameter.Type.STRING_ARRAY,
}

_DEPTH = integer("depth", 10, "-", "messages that are kept", low=1, high=1_000_000)  # what rcl makes of others is long


def _descriptor(p: Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        name=p.name,
        description=f"{p.description} [{p.unit}]" if p.unit != "-" else p.description,
        additional_constraints=p.expectation() + ("" if p.tunable else "; fixed at start"),
        read_only=not p.tunable,
    )
    if p.kind == "real" and not p.example and (p.low is not None or p.high is not None):  # NaN would be outside
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=-sys.float_info.max if p.low is None else float(p.low),
                to_value=sys.float_info.max if p.high is None else float(p.high),
            )
        ]
    if p.kind == "integer" and (p.low is not None or p.high is not None):
        descriptor.integer_range = [
            IntegerRange(
                from_value=-(2**63) if p.low is None else int(p.low),
                to_value=2**63 - 1 if p.high is None else int(p.high),
                step=1,
            )
        ]
    return descriptor


def declare(node: Node, table: Iterable[Parameter], canonical: Mapping[str, Any]) -> dict[str, Any]:
    """Declares a table on a node and returns the canonical values in force.

    Args:
        node: the ROS node; its command-line overrides win.
        table: specifications.
        canonical: values to declare as defaults.

    Raises:
        ParameterError: an override has the wrong type or a value that its specification refuses.
    """
    result: dict[str, Any] = {}
    for p in table:
        try:
            if not node.has_parameter(p.name):
                _declare(node, p, canonical[p.name])
        except (InvalidParameterTypeException, InvalidParameterValueException) as error:
            p.check(_plain(p, overrides_of(node)[p.name].value))  # says it in the words of a mission
            raise ParameterError(f"{p.name}: expected {p.expectation()} ({error})") from error
        result[p.name] = p.check(_plain(p, node.get_parameter(p.name).value))
    for name, given in overrides_of(node).items():
        if name.startswith("qos_overrides.") and name.endswith(".depth"):
            replace(_DEPTH, name=name).check(given.value)
    return result


def _declare(node: Node, p: Parameter, value: Any) -> None:
    if not p.is_array:
        node.declare_parameter(p.name, value, _descriptor(p))
        return
    # An empty list says nothing about its type to rclpy. Declared by type alone it has no value, and one parameter
    # without a value makes every read of several, as of `ros2 param dump`, fail: so it is given the value after that.
    open_to_change = _descriptor(p)
    open_to_change.read_only = False
    node.declare_parameter(p.name, _TYPES[p.kind], open_to_change)
    if node.get_parameter_or(p.name).value is None:
        overridden = p.name in overrides_of(node)
        node.set_parameters([RosParameter(p.name, _TYPES[p.kind], [] if overridden else list(value))])
    descriptor = _descriptor(p)
    descriptor.type = _TYPES[p.kind].value
    node.set_descriptor(p.name, descriptor)


def _plain(p: Parameter, value: Any) -> Any:
    return list(value or ()) if p.is_array and not isinstance(value, str) else value


def guard(
    node: Node,
    table: Iterable[Parameter],
    canonical: dict[str, Any],
    accept: Callable[[dict[str, Any]], None],
    refuse: Callable[[dict[str, Any]], str | None],
) -> None:
    """Lets `ros2 param set` change tunable parameters to sane values only.

    Args:
        node: the ROS node.
        table: specifications.
        canonical: values in force; kept up to date.
        accept: called with all canonical values after a change.
        refuse: says why a set of values that are each sane conflict, or None.
    """
    specifications = {p.name: p for p in table}

    def checked(parameters: list[RosParameter]) -> dict[str, Any]:
        return {
            q.name: specifications[q.name].check(list(q.value) if specifications[q.name].is_array else q.value)
            for q in parameters
            if q.name in specifications
        }

    def on_set(parameters: list[RosParameter]) -> SetParametersResult:
        try:
            changed = checked(parameters)
            reason = refuse(canonical | changed) if changed else None
        except (ParameterError, TypeError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:  # out of the service it would end the process
            return SetParametersResult(successful=False, reason=f"the check itself failed: {error!r}")
        return SetParametersResult(successful=reason is None, reason=reason or "")

    def after_set(parameters: list[RosParameter]) -> None:
        changed = checked(parameters)
        if changed:
            canonical.update(changed)
            accept(canonical)

    node.add_on_set_parameters_callback(on_set)
    node.add_post_set_parameters_callback(after_set)
