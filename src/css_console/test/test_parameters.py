# SPDX-License-Identifier: Apache-2.0
"""Parameters of nodes that take their time to answer."""

from types import SimpleNamespace
from typing import Any

from rcl_interfaces.msg import ListParametersResult
from rcl_interfaces.srv import ListParameters

from css_console.parameters import Parameters


def test_a_node_that_does_not_answer_is_asked_again():
    asked = []
    node: Any = SimpleNamespace(create_subscription=lambda *given: None)
    parameters = Parameters(node, lambda *given: asked.append(given))
    parameters.follow(["/ekf"])
    parameters.follow(["/ekf"])
    assert [service for service, *_ in asked] == ["/ekf/list_parameters"]
    *_, given_up = asked.pop()
    given_up("it compiles")
    parameters.follow(["/ekf"])
    (service, _, _, answered, _) = asked.pop()
    assert service == "/ekf/list_parameters"
    answered(ListParameters.Response(result=ListParametersResult(names=["gate"])))
    assert [service for service, *_ in asked] == ["/ekf/get_parameters", "/ekf/describe_parameters"]
    asked[0][-1]("it compiles still")
    parameters.follow(["/ekf"])
    assert asked[-1][0] == "/ekf/list_parameters"
