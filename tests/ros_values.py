# SPDX-License-Identifier: Apache-2.0
"""Parameters of a node as ROS has them."""

from typing import Any

from rclpy.node import Node


def values_of(node: Node) -> dict[str, Any]:
    """Values of all parameters of a node by name."""
    found: dict[str, Any] = {}
    everything: dict[str, Any] = node.get_parameters_by_prefix("")
    for name, parameter in everything.items():
        found[name] = parameter.value
    return found
