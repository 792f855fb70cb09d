# SPDX-License-Identifier: Apache-2.0
"""Definitions of messages for recordings: installed ones, else those of ROS 2 Jazzy that `rosbags` has."""

from css_common.tree_codec import plain_types
from css_recording.schemas import MessageSchema, is_installed, schema_of


def definition_of(type_name: str) -> MessageSchema:
    """Definition text and hash of a message type, installed or not."""
    if is_installed(type_name):
        return schema_of(type_name)
    store = plain_types()
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return MessageSchema(type_name, text, store.hash_rihs01(type_name))
