# SPDX-License-Identifier: Apache-2.0
"""What a rosbag2 folder says of its contents: `metadata.yaml` (version 9) and offered quality of service."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from css_recording.schemas import MessageSchema

METADATA_FILE = "metadata.yaml"
METADATA_VERSION = 9
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


class BagSummary(NamedTuple):
    """The figures of a finished recording."""

    file_name: str
    start_ns: int  # of the earliest message; 0 when there is none
    end_ns: int
    counts: Sequence[int]  # messages of each topic
    ros_distro: str
    notes: Mapping[str, str] = {}  # texts about the recording as a whole


def absolute(topic: str) -> str:
    """Topic name with its leading slash."""
    return topic if topic.startswith("/") else f"/{topic}"


def qos_text(profiles: Sequence[QosProfile]) -> str:
    """Value of the channel entry `offered_qos_profiles`."""
    return _dump([profile.as_dict() for profile in profiles])


def parse_qos(text: str) -> tuple[QosProfile, ...]:
    """Inverse of `qos_text`; profiles of older recordings, with numbers for names, are left out."""
    try:
        entries = yaml.safe_load(text) or []
        return tuple(
            QosProfile(entry["reliability"], entry["durability"], entry["history"], entry["depth"])
            for entry in entries
            if isinstance(entry["reliability"], str)
        )
    except (yaml.YAMLError, KeyError, TypeError):
        return ()


def bag_information(topics: Sequence[Topic], hashes: Sequence[str], summary: BagSummary) -> dict[str, Any]:
    """Contents of `metadata.yaml` below its one top-level key."""
    duration = {"nanoseconds": summary.end_ns - summary.start_ns}
    start = {"nanoseconds_since_epoch": summary.start_ns}
    total = sum(summary.counts)
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        "duration": duration,
        "starting_time": start,
        "message_count": total,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [profile.as_dict() for profile in topic.qos],
                    "type_description_hash": type_hash,
                },
                "message_count": count,
            }
            for topic, type_hash, count in zip(topics, hashes, summary.counts, strict=True)
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [summary.file_name],
        "files": [
            {
                "path": summary.file_name,
                "starting_time": dict(start),
                "duration": dict(duration),
                "message_count": total,
            }
        ],
        "custom_data": dict(summary.notes) or None,
        "ros_distro": summary.ros_distro,
    }


def metadata_text(information: Mapping[str, Any]) -> str:
    """Text of `metadata.yaml`."""
    return _dump({"rosbag2_bagfile_information": dict(information)})


def serialized_metadata(information: Mapping[str, Any]) -> str:
    """Text of the record `rosbag2` inside the recording: the same without the top-level key."""
    return _dump(dict(information))


def read_metadata(folder: Path) -> dict[str, Any] | None:
    """Contents of the folder's `metadata.yaml` below its top-level key; None when missing or unreadable."""
    try:
        document = yaml.safe_load((folder / METADATA_FILE).read_text(encoding="utf-8"))
        information = document["rosbag2_bagfile_information"]
        return information if isinstance(information, dict) else None
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError):
        return None


def _dump(value: Any) -> str:
    return str(yaml.dump(value, sort_keys=False, default_flow_style=False, Dumper=_NoAliasDumper))


class _NoAliasDumper(yaml.SafeDumper):
    """Writes equal parts out in full: not every YAML reader follows anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True
