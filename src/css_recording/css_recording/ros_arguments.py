# SPDX-License-Identifier: Apache-2.0
"""The command line of a program that is also a node."""

from collections.abc import Sequence


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """A command's own arguments, and those for ROS, from `--ros-args` on.

    `remove_ros_args` of rclpy is no help: it takes `OLD:=NEW` for its own wherever it stands.
    """
    at = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    return list(arguments[:at]), list(arguments[at:])
