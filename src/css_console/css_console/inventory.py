# SPDX-License-Identifier: Apache-2.0
"""What a graph consists of, by what its nodes offer: nothing of it is known beforehand, whoever started it."""

from collections.abc import Iterable
from typing import NamedTuple

from rclpy.node import Node

from css_console.taps import TYPES

_LIFECYCLE = "lifecycle_msgs/srv/ChangeState"
_FAULTS = "css_msgs/srv/InjectFault"
_RESET = "css_msgs/srv/ResetFlight"
_SEEK = ("css_msgs/srv/Seek", "rosbag2_interfaces/srv/Seek")
_PARAMETERS = "rcl_interfaces/srv/SetParameters"


class Inventory(NamedTuple):
    """Nodes by full name, topics with their writers.

    Attributes:
        topics: watched ones with the name of their type.
        writers: nodes that write each of them.
        lifecycle: nodes with a lifecycle.
        faulty: nodes that take faults.
        parameters: nodes with parameters.
        pace: node that holds and paces time; empty: none.
        player: node that plays a recording; empty: none.
        director: node that flies again; empty: none.
    """

    topics: tuple[tuple[str, str], ...] = ()
    writers: tuple[tuple[str, tuple[str, ...]], ...] = ()
    lifecycle: tuple[str, ...] = ()
    faulty: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    pace: str = ""
    player: str = ""
    director: str = ""

    @property
    def rivals(self) -> list[str]:
        """Topics that several nodes write, each with their names: what is shown of them may be a mixture."""
        return [f"{topic}: written by {' and '.join(nodes)}" for topic, nodes in self.writers if len(nodes) > 1]


def take_inventory(node: Node) -> Inventory:
    """What is there now, as far as the middleware has discovered it."""
    own = node.get_fully_qualified_name()
    offered = [
        (name, kind) for name, kinds in node.get_service_names_and_types() for kind in kinds if not name.startswith(own)
    ]
    topics = [(name, kinds[0]) for name, kinds in node.get_topic_names_and_types() if kinds and kinds[0] in TYPES]
    writers = {
        name: tuple(sorted(_full(info.node_namespace, info.node_name) for info in infos))
        for name, _ in topics
        for infos in (node.get_publishers_info_by_topic(name),)
    }
    seekers = _those(offered, _SEEK, "seek")
    pacers = [name.rpartition("/")[0] for name, _ in offered if name.endswith("/play_next_stamp")]
    return Inventory(
        topics=tuple(sorted((name, kind) for name, kind in topics if writers[name])),
        writers=tuple(sorted((name, nodes) for name, nodes in writers.items() if nodes)),
        lifecycle=_those(offered, (_LIFECYCLE,), "change_state"),
        faulty=_those(offered, (_FAULTS,), "inject_fault"),
        parameters=_those(offered, (_PARAMETERS,), "set_parameters"),
        # of a plant and a player beside it the plant: the player follows
        pace=next((name for name in sorted(pacers) if name not in seekers), next(iter(sorted(pacers)), "")),
        player=next(iter(seekers), ""),
        director=next(iter(_those(offered, (_RESET,), "reset")), ""),
    )


def _those(offered: Iterable[tuple[str, str]], kinds: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Nodes that offer a service of a kind."""
    found = (full.rpartition("/") for full, kind in offered if kind in kinds)
    return tuple(sorted({node for node, _, own in found if own == name}))


def _full(namespace: str, name: str) -> str:
    return f"{namespace.rstrip('/')}/{name}"
