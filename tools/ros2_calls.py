# SPDX-License-Identifier: Apache-2.0
"""What the small `ros2` asks of running nodes: `service call`, `param get`, `param set` and `lifecycle set`.

Arguments, output and exit codes are those of ros2cli; options are not there.
"""

from __future__ import annotations

import argparse
import importlib
from typing import Any

import rclpy
import yaml
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import get_parameter_value, parameter_value_to_python

_PATIENCE_S = 20.0


def call_service(arguments: argparse.Namespace) -> str | None:
    """Ask a service, and print what it answers; a string is a complaint."""
    package, _, name = arguments.service_type.replace("/srv/", "/").partition("/")
    try:
        kind = getattr(importlib.import_module(f"{package}.srv"), name)
    except (ImportError, AttributeError):
        return f"The passed service type is invalid: {arguments.service_type}"
    try:
        request = kind.Request()
        fill(request, yaml.safe_load(arguments.values) or {})
    except (yaml.YAMLError, AttributeError, AssertionError, TypeError, ValueError) as error:
        return f"Failed to populate field: {str(error).splitlines()[0]}"
    answer = ask(arguments.service_name, kind, request)
    if isinstance(answer, str):
        return answer
    print(f"response:\n{answer}\n")
    return None


def set_parameter(arguments: argparse.Namespace) -> str | None:
    """Set a parameter of a node; a string is a complaint."""
    name = arguments.parameter_name
    request = SetParameters.Request(parameters=[Parameter(name=name, value=get_parameter_value(arguments.value))])
    answer = ask(f"{arguments.node_name}/set_parameters", SetParameters, request)
    if isinstance(answer, str):
        return answer
    (result,) = answer.results
    if not result.successful:
        return f"Setting parameter failed: {result.reason}"
    print("Set parameter successful" + (f": {result.reason}" if result.reason else ""))
    return None


def get_parameter(arguments: argparse.Namespace) -> str | None:
    """Print the value of a parameter of a node; a string is a complaint."""
    request = GetParameters.Request(names=[arguments.parameter_name])
    answer = ask(f"{arguments.node_name}/get_parameters", GetParameters, request)
    if isinstance(answer, str):
        return answer
    if not answer.values or not answer.values[0].type:
        return "Parameter not set"
    print(f"Value is: {parameter_value_to_python(answer.values[0])}")
    return None


def set_lifecycle(arguments: argparse.Namespace) -> str | None:
    """Take a node through a transition; a string is a complaint."""
    number = getattr(Transition, f"TRANSITION_{arguments.transition.upper()}", None)
    if number is None:
        return f"Unknown transition requested: {arguments.transition}"
    request = ChangeState.Request(transition=Transition(id=number))
    answer = ask(f"{arguments.node_name}/change_state", ChangeState, request)
    if isinstance(answer, str):
        return answer
    if not answer.success:
        return "Transitioning failed"
    print("Transitioning successful")
    return None


def fill(message: Any, values: dict[str, Any]) -> None:
    """Put values by name into a message."""
    for name, value in values.items():
        own = getattr(message, name)
        if isinstance(value, dict):
            fill(own, value)
        elif isinstance(value, list):
            numbers = getattr(own, "typecode", "") in ("d", "f")
            setattr(message, name, [float(item) for item in value] if numbers else value)
        else:
            setattr(message, name, float(value) if isinstance(own, float) else value)


def ask(service: str, kind: Any, request: Any) -> Any:
    """What a service answers, or a complaint."""
    rclpy.init()
    node = rclpy.create_node("_ros2_calls")
    try:
        client = node.create_client(kind, service)
        if not client.wait_for_service(_PATIENCE_S):
            return f"{service}: no such service after {_PATIENCE_S:g} s"
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=_PATIENCE_S)
        return future.result() if future.done() else f"{service}: no answer after {_PATIENCE_S:g} s"
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
