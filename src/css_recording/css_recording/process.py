# SPDX-License-Identifier: Apache-2.0
"""Beginning and end of a process: its arguments, and being asked to stop."""

import signal
from collections.abc import Sequence


class StopSignal:
    """Remembers that the process was asked to end, by SIGINT, SIGTERM or a closed terminal.

    As a context manager it does so inside only: at the end signals mean again what they meant before.

    Attributes:
        came: it was.
    """

    def __init__(self) -> None:
        self.came = False
        self._before = {
            number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        }

    def __enter__(self) -> "StopSignal":
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: object) -> None:
        self.came = True


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """A command's own arguments, and those for ROS, from `--ros-args` on.

    `remove_ros_args` of rclpy is no help: it takes `OLD:=NEW` for its own wherever it stands.
    """
    at = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    return list(arguments[:at]), list(arguments[at:])
