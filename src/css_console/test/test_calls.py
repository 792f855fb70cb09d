# SPDX-License-Identifier: Apache-2.0
"""Orders become the services, parameters and lifecycle calls that the commands beside them make."""

import json
import math
import shlex

import pytest
import yaml
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger

from css_console.calls import Known, calls_of
from css_console.errors import OrderError
from css_console.orders import order_of
from css_msgs.srv import InjectFault, ResetFlight, Seek

BEGIN_NS = 1_370_044_800_000_000_000
KNOWN = Known(
    pace="/dynamics",
    player="/player",
    director="/flight",
    begin_ns=BEGIN_NS,
    types={
        ("/ekf", "gate"): ParameterType.PARAMETER_DOUBLE,
        ("/ekf", "use_gyro"): ParameterType.PARAMETER_BOOL,
        ("/ekf", "depth"): ParameterType.PARAMETER_INTEGER,
        ("/ekf", "name"): ParameterType.PARAMETER_STRING,
        ("/ekf", "axis"): ParameterType.PARAMETER_DOUBLE_ARRAY,
        ("/ekf", "faults"): ParameterType.PARAMETER_STRING_ARRAY,
    },
)


def call_of(**order):
    (call,) = calls_of(order_of(json.dumps(order)), KNOWN)
    return call


@pytest.mark.parametrize(("do", "service"), [("pause", "pause"), ("resume", "resume"), ("step", "play_next_stamp")])
def test_pace(do, service):
    call = call_of(do=do)
    assert (call.service, call.type) == (f"/dynamics/{service}", Trigger)
    assert call.command == f"ros2 service call /dynamics/{service} std_srvs/srv/Trigger"
    assert call.verdict(Trigger.Response(success=False, message="not paused: pause first")) == (
        False,
        "not paused: pause first",
    )


@pytest.mark.parametrize(("rate", "value", "word"), [(2, 2.0, "2.0"), (0.5, 0.5, "0.5"), (0, math.inf, ".inf")])
def test_rate(rate, value, word):
    call = call_of(do="rate", rate=rate)
    (parameter,) = call.request.parameters
    assert (parameter.name, parameter.value.double_value) == ("rate", value)
    assert call.command == f"ros2 param set /dynamics rate {word}"
    assert yaml.safe_load(word) == value


@pytest.mark.parametrize(
    ("name", "value", "field", "sent"),
    [
        ("gate", 1, "double_value", 1.0),
        ("gate", 0.25, "double_value", 0.25),
        ("use_gyro", False, "bool_value", False),
        ("depth", 3, "integer_value", 3),
        ("depth", 3.0, "integer_value", 3),
        ("name", "a b", "string_value", "a b"),
        ("axis", [1, 0.5], "double_array_value", [1.0, 0.5]),
        ("faults", ["cell.0 dead from=3"], "string_array_value", ["cell.0 dead from=3"]),
        ("faults", [], "string_array_value", []),
    ],
)
def test_a_parameter_is_set_with_its_own_type(name, value, field, sent):
    call = call_of(do="set", node="/ekf", name=name, value=value)
    (parameter,) = call.request.parameters
    assert parameter.value.type == KNOWN.types["/ekf", name]
    found = getattr(parameter.value, field)
    assert (list(found) if isinstance(sent, list) else found) == sent
    assert yaml.safe_load(shlex.split(call.command)[-1]) == value
    answer = SetParameters.Response(results=[SetParametersResult(successful=False, reason="gate: 7 given")])
    assert call.verdict(answer) == (False, "gate: 7 given")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [("gate", "much", "double"), ("depth", 2.5, "integer"), ("use_gyro", 1, "bool"), ("axis", 1.0, "double array")],
)
def test_a_value_of_another_type_never_reaches_the_node(name, value, expected):
    with pytest.raises(OrderError, match=f"expected a value of type {expected}"):
        call_of(do="set", node="/ekf", name=name, value=value)


def test_what_cannot_be_set_in_flight_is_said():
    with pytest.raises(OrderError, match=r"/ekf has no parameter 'mission\.case' that can be set in flight"):
        call_of(do="set", node="/ekf", name="mission.case", value=3)


def test_lifecycle():
    call = call_of(do="lifecycle", node="/gyro", transition="deactivate")
    assert (call.service, call.type) == ("/gyro/change_state", ChangeState)
    assert call.request.transition.id == Transition.TRANSITION_DEACTIVATE
    assert call.command == "ros2 lifecycle set /gyro deactivate"
    assert call.verdict(ChangeState.Response(success=False))[1] == "/gyro refuses to deactivate; its log says why"


def test_faults():
    call = call_of(do="inject", node="/css_array", target="cell.3", kind="stuck", values=[1], duration=2)
    assert (call.service, call.type) == ("/css_array/inject_fault", InjectFault)
    assert (call.request.target, call.request.kind, list(call.request.values), call.request.duration) == (
        "cell.3", "stuck", [1.0], 2.0
    )  # fmt: skip
    assert call_of(do="clear", node="/css_array").request.fault == ""


def test_reset():
    call = call_of(do="reset", case=7, overrides=["ekf.gate=0.2"], keep=True, paused=True)
    assert (call.service, call.type) == ("/flight/reset", ResetFlight)
    request = call.request
    assert (request.mission, request.case_number, request.overrides, request.keep, request.paused) == (
        "", 7, ["ekf.gate=0.2"], True, True
    )  # fmt: skip
    shown = yaml.safe_load(shlex.split(call.command)[-1])
    assert shown["case_number"] == 7 and shown["overrides"] == ["ekf.gate=0.2"]


def test_seek_counts_from_where_the_page_does():
    call = call_of(do="seek", time=20.5)
    assert (call.service, call.type) == ("/player/seek", Seek)
    assert (call.request.time.sec, call.request.time.nanosec) == (1_370_044_820, 500_000_000)
    assert yaml.safe_load(shlex.split(call.command)[-1]) == {"time": {"sec": 1_370_044_820, "nanosec": 500_000_000}}


@pytest.mark.parametrize(
    ("order", "lacks"),
    [({"do": "pause"}, "holds and paces"), ({"do": "seek", "time": 1}, "plays"), ({"do": "reset"}, "flies again")],
)
def test_what_no_node_can_do_is_said(order, lacks):
    with pytest.raises(OrderError, match=f"no node in this graph that {lacks}"):
        calls_of(order_of(json.dumps(order)), Known())
