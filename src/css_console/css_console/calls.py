# SPDX-License-Identifier: Apache-2.0
"""What orders of a browser are in ROS: services, parameters and lifecycle calls, each with the command that does it."""

import json
import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import Trigger

from css_common.pace_controls import rosbag2_service
from css_common.schema import shown
from css_console.errors import OrderError
from css_console.orders import Order
from css_msgs.srv import ClearFault, InjectFault, ResetFlight, Seek

_TRANSITIONS = {
    "configure": Transition.TRANSITION_CONFIGURE,
    "activate": Transition.TRANSITION_ACTIVATE,
    "deactivate": Transition.TRANSITION_DEACTIVATE,
    "cleanup": Transition.TRANSITION_CLEANUP,
}
_PACE = {"pause": ("pause", "Pause"), "resume": ("resume", "Resume"), "step": ("play_next_stamp", None)}

Verdict = tuple[bool, str]
"""Whether it was done, and what was said about it."""


class Call(NamedTuple):
    """One call of a service.

    Attributes:
        service: its full name.
        type: of the service.
        request: what is asked.
        command: does the same from a shell.
        verdict: reads the answer.
    """

    service: str
    type: type
    request: Any
    command: str
    verdict: Callable[[Any], Verdict]


class Known(NamedTuple):
    """What of the graph calls are addressed to; an empty name: there is none.

    Attributes:
        pace: node that holds and paces, the plant or a player.
        player: node that goes to an instant of a recording.
        director: node that flies again.
        begin_ns: stamp from which the seconds of the page count.
        types: types (`ParameterType`) of parameters by node and name.
    """

    pace: str = ""
    player: str = ""
    director: str = ""
    begin_ns: int = 0
    types: Mapping[tuple[str, str], int] = {}


def calls_of(order: Order, known: Known) -> list[Call]:
    """The calls that do what an order says, one after the other.

    Raises:
        OrderError: the graph has nothing that could do it.
    """
    fields = order.fields
    if order.do in _PACE:
        name, kind = _PACE[order.do]
        return [_pace_call(_of(known.pace, "holds and paces time"), name, rosbag2_service(kind) or Trigger)]
    if order.do == "rate":
        node = _of(known.pace, "holds and paces time")
        return [_set_call(node, "rate", float(fields["rate"]) or math.inf, ParameterType.PARAMETER_DOUBLE)]
    if order.do == "seek":
        return [_seek_call(_of(known.player, "plays a recording"), known.begin_ns, fields["time"])]
    if order.do == "set":
        node, name = fields["node"], fields["name"]
        if (node, name) not in known.types:
            raise OrderError(f"{node} has no parameter {shown(name)} that can be set in flight")
        return [_set_call(node, name, fields["value"], known.types[node, name])]
    if order.do == "lifecycle":
        return [_lifecycle_call(fields["node"], fields["transition"])]
    if order.do == "inject":
        names = ("target", "kind", "values", "duration")
        return [_told_call(f"{fields['node']}/inject_fault", InjectFault, {name: fields[name] for name in names})]
    if order.do == "clear":
        return [_told_call(f"{fields['node']}/clear_fault", ClearFault, {"fault": fields["fault"]})]
    assert order.do == "reset"
    wish = {"case_number" if name == "case" else name: value for name, value in fields.items()}
    return [_told_call(f"{_of(known.director, 'flies again: only fly --stay does')}/reset", ResetFlight, wish)]


def _of(node: str, what: str) -> str:
    if not node:
        raise OrderError(f"there is no node in this graph that {what}")
    return node


def _pace_call(node: str, name: str, kind: Any) -> Call:
    def verdict(answer: Any) -> Verdict:
        return getattr(answer, "success", True), getattr(answer, "message", "")

    return _call(f"{node}/{name}", kind, kind.Request(), {}, verdict)


def _told_call(service: str, kind: Any, fields: Mapping[str, Any]) -> Call:
    """Of a service whose answer says whether, and why not."""
    request = kind.Request()
    for name, value in fields.items():
        own = getattr(request, name)
        setattr(request, name, [float(v) for v in value] if name == "values" else type(own)(value))
    return _call(service, kind, request, fields, lambda answer: (answer.success, answer.message))


def _seek_call(node: str, begin_ns: int, time_s: float) -> Call:
    kind: Any = rosbag2_service("Seek") or Seek
    request = kind.Request()
    request.time.sec, request.time.nanosec = divmod(begin_ns + round(time_s * 1e9), 1_000_000_000)
    shows = {"time": {"sec": request.time.sec, "nanosec": request.time.nanosec}}

    def verdict(answer: Any) -> Verdict:
        return answer.success, getattr(answer, "message", "")

    return _call(f"{node}/seek", kind, request, shows, verdict)


def _call(service: str, kind: type, request: Any, fields: Mapping[str, Any], verdict: Callable[[Any], Verdict]) -> Call:
    package = kind.__module__.split(".")[0]
    words = ["ros2", "service", "call", service, f"{package}/srv/{kind.__name__}"]
    words += [_yaml(fields)] if fields else []
    return Call(service, kind, request, shlex.join(words), verdict)


def _lifecycle_call(node: str, transition: str) -> Call:
    request = ChangeState.Request()
    request.transition.id = _TRANSITIONS[transition]
    command = shlex.join(["ros2", "lifecycle", "set", node, transition])
    refused = f"{node} refuses to {transition}; its log says why"
    return Call(
        f"{node}/change_state", ChangeState, request, command, lambda a: (a.success, "" if a.success else refused)
    )


def _set_call(node: str, name: str, value: Any, kind: int) -> Call:
    request = SetParameters.Request()
    try:
        own = RosParameter.Type(kind)
        parameter = RosParameter(name, own, _as(own, value)).to_parameter_msg()
    except (TypeError, ValueError):
        raise OrderError(f"{name}: {shown(value)} given, expected a value of type {_TYPES[kind]}") from None
    request.parameters = [parameter]
    command = shlex.join(["ros2", "param", "set", node, name, _yaml(value_of(parameter.value))])

    def verdict(answer: Any) -> Verdict:
        (result,) = answer.results
        return result.successful, result.reason

    return Call(f"{node}/set_parameters", SetParameters, request, command, verdict)


_TYPES = {
    number: name.removeprefix("PARAMETER_").lower().replace("_", " ")
    for name, number in (
        (name, getattr(ParameterType, name)) for name in dir(type(ParameterType)) if name.startswith("PARAMETER_")
    )
}


def _as(kind: RosParameter.Type, value: Any) -> Any:
    """A value from JSON as the type of a parameter has it: numbers without fraction are whole in JSON."""
    if kind == RosParameter.Type.DOUBLE and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if kind == RosParameter.Type.INTEGER and isinstance(value, float) and value.is_integer():
        return int(value)
    if kind == RosParameter.Type.DOUBLE_ARRAY and isinstance(value, list):
        return [float(item) for item in value]
    return value


def value_of(value: ParameterValue) -> Any:
    """The value in a message, as JSON can have it."""
    plain = RosParameter.from_parameter_msg(Parameter(name="value", value=value)).value
    return (
        list(plain)
        if (isinstance(plain, Sequence) and not isinstance(plain, str)) or hasattr(plain, "tolist")
        else plain
    )


def _yaml(value: Any) -> str:
    """A value on one line, as the command line of ROS reads it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {_yaml(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_yaml, value)) + "]"
    if isinstance(value, float) and math.isinf(value):
        return ".inf" if value > 0 else "-.inf"
    return json.dumps(value)
