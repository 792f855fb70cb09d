# SPDX-License-Identifier: Apache-2.0
"""Quality of service that a user sets for topics, in a file of the form that rosbag2 reads.

For instance:

    /css/voltages:
      reliability: best_effort
      durability: volatile
      history: keep_last
      depth: 10

Further keys: deadline, lifespan and liveliness_lease_duration (each with sec and nsec), liveliness,
avoid_ros_namespace_conventions. What is left out has ROS's default.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    InvalidQoSProfileException,
    LivelinessPolicy,
    QoSPolicyEnum,
    QoSProfile,
    ReliabilityPolicy,
)

from css_common.file_text import decoded
from css_recording.bag_metadata import absolute
from css_recording.errors import BagError

_POLICIES: dict[str, type[QoSPolicyEnum]] = {
    "history": HistoryPolicy,
    "reliability": ReliabilityPolicy,
    "durability": DurabilityPolicy,
    "liveliness": LivelinessPolicy,
}
_DURATIONS = ("deadline", "lifespan", "liveliness_lease_duration")
_PLAIN: dict[str, tuple[Callable[[Any], bool], str]] = {
    "depth": (lambda value: type(value) is int and value >= 0, "a whole number from 0 on"),
    "avoid_ros_namespace_conventions": (lambda value: isinstance(value, bool), "true or false"),
}
_KEYS = (*_POLICIES, *_DURATIONS, *_PLAIN)


def read_qos_overrides(path: Path | None) -> dict[str, QoSProfile]:
    """Quality of service of each topic that a file names; nothing without a file.

    Raises:
        BagError: the file cannot be read, or a key or a value in it is none.
    """
    if path is None:
        return {}
    try:
        document = yaml.safe_load(decoded(path.read_bytes()))
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise BagError(f"{path}: cannot be read: {error}") from error
    except yaml.YAMLError as error:
        raise BagError(f"{path}: is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(document, dict) or not document:
        raise BagError(f"{path}: expected topics, each with its quality of service below it")
    return {absolute(str(topic)): _profile(f"{path}: {topic}", entries) for topic, entries in document.items()}


def _profile(where: str, entries: Any) -> QoSProfile:
    if not isinstance(entries, dict):
        raise BagError(f"{where}: {entries!r} given, expected keys such as reliability: best_effort")
    chosen: dict[str, Any] = {"history": HistoryPolicy.KEEP_LAST, "depth": 10}
    for key, value in entries.items():
        chosen[str(key)] = _value(f"{where}: {key}", str(key), value)
    try:
        return QoSProfile(**chosen)
    except (InvalidQoSProfileException, TypeError, ValueError) as error:
        raise BagError(f"{where}: {error}") from error


def _value(where: str, key: str, value: Any) -> Any:
    if key in _POLICIES:
        names = [name.lower() for name in _POLICIES[key].short_keys()]
        if str(value).lower() not in names:
            raise BagError(f"{where}: {value!r} given, expected one of {', '.join(names)}")
        return _POLICIES[key].get_from_short_key(str(value))
    if key in _DURATIONS:
        return _duration(where, value)
    if key not in _KEYS:
        raise BagError(f"{where}: no such key, expected one of {', '.join(_KEYS)}")
    is_right, expected = _PLAIN[key]
    if not is_right(value):
        raise BagError(f"{where}: {value!r} given, expected {expected}")
    return value


def _duration(where: str, value: Any) -> Duration:
    parts = value if isinstance(value, Mapping) else {}
    sec, nsec = parts.get("sec", 0), parts.get("nsec", 0)
    if not parts or set(parts) - {"sec", "nsec"} or type(sec) is not int or type(nsec) is not int or min(sec, nsec) < 0:
        raise BagError(f"{where}: {value!r} given, expected sec and nsec, whole numbers from 0 on")
    return Duration(seconds=sec, nanoseconds=nsec)
