# SPDX-License-Identifier: Apache-2.0
"""Services and a parameter that hold a flight or a playback, step it and change its rate, as rosbag2 has them.

Where `rosbag2_interfaces` is installed the services have its types; where it is not, those without an argument are
`std_srvs/srv/Trigger`, whose text answers, and the rate is set by the parameter.
"""

import importlib
import math
from collections.abc import Callable
from typing import Any, Protocol

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

_FASTER = 1.1
_RATE = "rate"


class Pace(Protocol):
    """When the next stamp is due.

    Attributes:
        paused: nothing is due but what is granted.
        rate: stamped seconds per second of the wall clock, above 0; infinite: as fast as it goes.
    """

    paused: bool

    @property
    def rate(self) -> float:
        """See above."""

    @rate.setter
    def rate(self, rate: float) -> None: ...

    def pause(self) -> None:
        """Holds at the stamp that is reached."""

    def resume(self) -> None:
        """Goes on."""

    def grant_stamp(self) -> None:
        """Makes one more stamp due while held."""


class PaceControls:
    """What people and other nodes do to a pace."""

    def __init__(self, node: Node, pace: Pace, grant_message: Callable[[], None] | None = None) -> None:
        """Creates the services `~/pause`, `~/resume` and so on, and the parameter `rate` with the pace's rate.

        Args:
            node: has them.
            pace: is controlled by them.
            grant_message: makes one more message due while held, where that is possible.

        Raises:
            ValueError: a rate from the command line of ROS is none.
        """
        self._node, self._pace, self._grant_message = node, pace, grant_message
        descriptor = ParameterDescriptor(
            description="stamped seconds per second of the wall clock, above 0; inf: as fast as it goes"
        )
        rate = node.declare_parameter(_RATE, float(pace.rate), descriptor).value
        if not _is_rate(rate):
            raise ValueError(f"parameter rate: {rate} given, expected a number above 0")
        pace.rate = float(rate)
        node.add_on_set_parameters_callback(self._set_parameters)
        self._keys = {
            "space": self.toggle,
            "s": self.play_next_stamp,
            "up": lambda: self.change_rate(pace.rate * _FASTER),
            "down": lambda: self.change_rate(pace.rate / _FASTER),
        }
        self._serve("pause", "Pause", self.pause)
        self._serve("resume", "Resume", self.resume)
        self._serve("toggle_paused", "TogglePaused", self.toggle)
        self._serve("is_paused", "IsPaused", lambda: None, paused=lambda: pace.paused)
        if grant_message is not None:
            self._keys["right"] = self.play_next
            self._serve("play_next", "PlayNext", self.play_next)
        self._serve("play_next_stamp", None, self.play_next_stamp)
        self._serve("get_rate", "GetRate", lambda: None, rate=lambda: pace.rate)
        self._serve_set_rate()

    def press(self, key: str) -> None:
        """Does what a key stands for; others do nothing."""
        if key in self._keys:
            self._node.get_logger().info(self._keys[key]()[1])

    def pause(self) -> tuple[bool, str]:
        """Holds; whether that did something, and what."""
        self._pace.pause()
        return True, "paused"

    def resume(self) -> tuple[bool, str]:
        """Goes on."""
        self._pace.resume()
        return True, "playing"

    def toggle(self) -> tuple[bool, str]:
        """Holds, or goes on."""
        return self.resume() if self._pace.paused else self.pause()

    def play_next(self) -> tuple[bool, str]:
        """Plays one more message while held."""
        return self._step(self._grant_message, "one message")

    def play_next_stamp(self) -> tuple[bool, str]:
        """Plays all messages of one more stamp while held."""
        return self._step(self._pace.grant_stamp, "one stamp")

    def change_rate(self, rate: float) -> tuple[bool, str]:
        """Sets the rate, and the parameter that shows it."""
        self._node.set_parameters([Parameter(_RATE, value=float(rate))])
        return True, f"rate {self._pace.rate:.3g}"

    def _step(self, grant: Callable[[], None] | None, what: str) -> tuple[bool, str]:
        if grant is None:
            return False, f"{what}: not to be had here"
        if not self._pace.paused:
            return False, "not paused: pause first"
        grant()
        return True, what

    def _set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == _RATE:
                if not _is_rate(parameter.value):
                    return SetParametersResult(
                        successful=False, reason=f"rate: {parameter.value} given, expected a number above 0"
                    )
                self._pace.rate = float(parameter.value)
        return SetParametersResult(successful=True)

    def _serve(
        self, name: str, rosbag2_type: str | None, action: Callable[[], Any], **answer: Callable[[], Any]
    ) -> None:
        """A service without an argument; `answer` has the fields of rosbag2's response that are more than success."""
        service = rosbag2_service(rosbag2_type) or Trigger

        def serve(_: Any, response: Any) -> Any:
            success, text = action() or (True, ", ".join(f"{key}: {value()}" for key, value in answer.items()))
            values = {"success": success, "message": text, **{key: value() for key, value in answer.items()}}
            for key in response.get_fields_and_field_types():
                if key in values:
                    setattr(response, key, values[key])
            return response

        self._node.create_service(service, f"~/{name}", serve)

    def _serve_set_rate(self) -> None:
        service = rosbag2_service("SetRate")
        if service is None:
            return

        def serve(request: Any, response: Any) -> Any:
            response.success = _is_rate(request.rate)
            if response.success:
                self.change_rate(request.rate)
            return response

        self._node.create_service(service, "~/set_rate", serve)


def rosbag2_service(name: str | None) -> type | None:
    """A service type of rosbag2; None where its interfaces are not installed."""
    if name is None:
        return None
    try:
        return getattr(importlib.import_module("rosbag2_interfaces.srv"), name, None)
    except ImportError:
        return None


def _is_rate(value: Any) -> bool:
    return isinstance(value, float) and not math.isnan(value) and value > 0.0
