# SPDX-License-Identifier: Apache-2.0
"""Values of parameter events, read without rclpy, are those that rclpy gives for the same bytes."""

import array

import pytest
from rcl_interfaces.msg import Parameter, ParameterEvent
from rclpy.parameter import Parameter as RosParameter
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import serialize_message

from css_recording.parameter_events import read_setting

VALUES = {
    "flag": True, "count": -(2**62), "gain": 0.1, "name": "größe", "flags": [True, False], "counts": [3, -4],
    "gains": [0.1, -2.5, 1e300], "names": ["a", "", "b c"], "none": None,
}  # fmt: skip


def event(**values):
    parameters = [
        Parameter(name=name, value=RosParameter(name, value=v).get_parameter_value()) for name, v in values.items()
    ]
    return ParameterEvent(node="/flight/ekf", changed_parameters=parameters)


@pytest.mark.parametrize("name", VALUES)
def test_a_value_of_each_type(name):
    sent = event(**{name: VALUES[name]})
    setting = read_setting(serialize_message(sent), 17)
    expected = parameter_value_to_python(sent.changed_parameters[0].value)
    expected = expected.tolist() if isinstance(expected, array.array) else expected
    assert (setting.stamp_ns, setting.node) == (17, "ekf")
    assert setting.values == {name: expected}
    assert type(setting.values[name]) is type(expected)


def test_all_that_changed_in_one_message_and_nothing_else():
    sent = event(**VALUES)
    sent.new_parameters = event(other=1).changed_parameters
    assert set(read_setting(serialize_message(sent), 0).values) == set(VALUES)
