# SPDX-License-Identifier: Apache-2.0
"""Errors of rcl and rclpy in one line that says what would have been right."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.logging import LoggingSeverity, get_logger_level, set_logger_level

from css_common.ros_internals import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from css_common.schema import ParameterError

REFUSALS = (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError, NameValidationException, ParameterException)
"""What rclpy raises for arguments, names, parameters and quality of service that ROS does not take."""

_RULES = {
    "parameter override rule": "expected -p KEY:=VALUE, with the value as in a parameter file",
    "remap rule": "expected -r FROM:=TO, both names of topics, or -r __node:=NAME or -r __ns:=/NAMESPACE",
}


def explained(error: Exception) -> str:
    """One line for an error of rcl or rclpy."""
    if isinstance(error, UnknownROSArgsError):
        unknown = re.findall(r"'(.*?)'", str(error))
        return f"{' '.join(unknown)}: unknown after --ros-args"
    text = " ".join(str(error).split())
    rule = re.search(r"Couldn't parse ([a-z ]+): '(.*)'\. Error: ", text)
    if rule and rule[1] in _RULES:
        return f"{rule[2]}: {_RULES[rule[1]]}"
    text = re.sub(r",? at /\S+:\d+", "", text)  # lines of rcl's own sources
    return text.removeprefix("failed to initialize rcl: ").removeprefix("error creating node: ").rstrip(".,")


@contextmanager
def in_own_words() -> Iterator[None]:
    """Keeps rcl from logging an error that is raised as well."""
    level = get_logger_level("rcl")
    set_logger_level("rcl", LoggingSeverity.FATAL)
    try:
        yield
    finally:
        if get_logger_level("rcl") == LoggingSeverity.FATAL:  # else the command line has set another one
            set_logger_level("rcl", level)


@contextmanager
def endpoint(topic: str) -> Iterator[None]:
    """Names the topic when ROS refuses its publisher or subscription: a remapped name, a quality of service.

    Raises:
        ParameterError: it did.
    """
    try:
        yield
    except (*REFUSALS, RuntimeError, TypeError) as error:  # rclpy says the same of policies in several ways
        raise ParameterError(f"{topic}: {explained(error)}") from error
