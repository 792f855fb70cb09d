# SPDX-License-Identifier: Apache-2.0
"""What a process that is also a node does with its command line and with ROS."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import rclpy
from rclpy.signals import SignalHandlerOptions

from css_common.ros_internals import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError


class RosArgumentsError(Exception):
    """What was given to ROS cannot be understood. The text is one line."""


@contextmanager
def ros_process(name: str, for_ros: Sequence[str]) -> Iterator[None]:
    """ROS, while the context lasts.

    Signals stay with the command: rclpy would shut its context down with messages still waiting to be taken.

    Args:
        name: of the program, for ROS.
        for_ros: arguments from `--ros-args` on.

    Raises:
        RosArgumentsError: they are wrong.
    """
    try:
        rclpy.init(args=[name, *for_ros], signal_handler_options=SignalHandlerOptions.NO)
    except (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError) as error:
        reason = str(error).splitlines()[0].removeprefix("failed to initialize rcl: ").split(", at /")[0]
        raise RosArgumentsError(f"{' '.join(for_ros)}: {reason}") from error
    try:
        yield
    finally:
        rclpy.try_shutdown()
