# SPDX-License-Identifier: Apache-2.0
"""What a rosbag2 folder says of its contents: `metadata.yaml` (version 9) and offered quality of service."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from css_recording.schemas import MessageSchema

METADATA_FILE = "metadata.yaml"
METADATA_VERSION = 9
RECOVERY_NOTE = "recovery"
"""Text about a recording as a whole: what a recovery could not save."""
_MOST_BYTES = 4 << 20
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_UNREADABLE = (yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError, OverflowError)
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


class QosProfile(NamedTuple):
    """Quality of service that the publisher of a recorded topic offered."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10

    def as_dict(self) -> dict[str, Any]:
        """In rosbag2's own words; deadline, lifespan and lease are always unlimited."""
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }


class Topic(NamedTuple):
    """A topic of a recording."""

    name: str  # absolute: "/css/voltages"
    type: str  # "css_msgs/msg/CssVoltages"
    qos: tuple[QosProfile, ...] = (QosProfile(),)  # one for each publisher
    schema: MessageSchema | None = None  # default: that of the installed type
    encoding: str = "cdr"  # of the messages


class FileSummary(NamedTuple):
    """The figures of one file of a recording."""

    name: str
    start_ns: int  # of the earliest message; 0 when there is none
    end_ns: int
    count: int  # type: ignore[assignment]  # the method of tuples that it hides is not missed


class BagSummary(NamedTuple):
    """The figures of a finished recording."""

    files: Sequence[FileSummary]
    counts: Sequence[int]  # messages of each topic
    ros_distro: str
    notes: Mapping[str, str] = {}  # texts about the recording as a whole
    storage: str = "mcap"


def ros_distro() -> str:
    """Name of the ROS distribution that is sourced."""
    return os.environ.get("ROS_DISTRO", "jazzy")


def absolute(topic: str) -> str:
    """Topic name with its leading slash."""
    return topic if topic.startswith("/") else f"/{topic}"


def qos_text(profiles: Sequence[QosProfile]) -> str:
    """Value of the channel entry `offered_qos_profiles`."""
    return _dump([profile.as_dict() for profile in profiles])


def parse_qos(text: str) -> tuple[QosProfile, ...]:
    """Inverse of `qos_text`; profiles of older recordings, with numbers for names, are left out."""
    try:
        entries = _load(text) or []
        return tuple(
            QosProfile(entry["reliability"], entry["durability"], entry["history"], entry["depth"])
            for entry in entries
            if isinstance(entry["reliability"], str)
        )
    except (*_UNREADABLE, AttributeError):
        return ()


def bag_information(topics: Sequence[Topic], hashes: Sequence[str], summary: BagSummary) -> dict[str, Any]:
    """Contents of `metadata.yaml` below its one top-level key."""
    filled = [file for file in summary.files if file.count] or summary.files
    start_ns, end_ns = min(file.start_ns for file in filled), max(file.end_ns for file in filled)
    return {
        "version": METADATA_VERSION,
        "storage_identifier": summary.storage,
        **_span(start_ns, end_ns),
        "message_count": sum(summary.counts),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": [profile.as_dict() for profile in topic.qos],
                    "type_description_hash": type_hash,
                },
                "message_count": count,
            }
            for topic, type_hash, count in zip(topics, hashes, summary.counts, strict=True)
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in summary.files],
        "files": [
            {
                "path": file.name,
                **dict(reversed(_span(file.start_ns, file.end_ns).items())),
                "message_count": file.count,
            }
            for file in summary.files
        ],
        "custom_data": dict(summary.notes) or None,
        "ros_distro": summary.ros_distro,
    }


def _span(start_ns: int, end_ns: int) -> dict[str, dict[str, int]]:
    return {
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
    }


def metadata_text(information: Mapping[str, Any]) -> str:
    """Text of `metadata.yaml`."""
    return _dump({"rosbag2_bagfile_information": dict(information)})


def serialized_metadata(information: Mapping[str, Any]) -> str:
    """Text of the record `rosbag2` inside the recording: the same without the top-level key."""
    return _dump(dict(information))


def read_metadata(folder: Path) -> dict[str, Any] | None:
    """Contents of the folder's `metadata.yaml` below its top-level key.

    None when it is missing, unreadable, or does not say which files of which storage the recording has.
    """
    path = folder / METADATA_FILE
    try:
        if path.stat().st_size > _MOST_BYTES:
            return None
        information = _load(path.read_text(encoding="utf-8"))["rosbag2_bagfile_information"]
        files = information["relative_file_paths"]
        named = isinstance(files, list) and files and all(isinstance(file, str) and file for file in files)
        return information if named and isinstance(information["storage_identifier"], str) else None
    except (OSError, *_UNREADABLE):
        return None


def recovery_note(information: Mapping[str, Any]) -> str:
    """What a recovery could not save, as `metadata.yaml` tells; empty: nothing."""
    custom = information.get("custom_data")
    return str(custom.get(RECOVERY_NOTE) or "") if isinstance(custom, dict) else ""


def recorded_hashes(information: Mapping[str, Any]) -> dict[str, str]:
    """Type hashes by topic, as `metadata.yaml` gives them."""
    try:
        topics = [entry["topic_metadata"] for entry in information["topics_with_message_count"]]
        return {absolute(str(t["name"])): str(t.get("type_description_hash") or "") for t in topics}
    except (KeyError, TypeError, AttributeError):
        return {}


def _load(text: str) -> Any:
    return yaml.load(text, Loader=_LOADER)


def _dump(value: Any) -> str:
    return str(yaml.dump(value, sort_keys=False, default_flow_style=False, Dumper=_NoAliasDumper))


class _NoAliasDumper(yaml.SafeDumper):
    """Writes equal parts out in full: not every YAML reader follows anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True
