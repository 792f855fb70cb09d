# SPDX-License-Identifier: Apache-2.0
"""A bench for tests of nodes: components hosted in this process, messages in and out, without sleeps.

Every wait is for a condition, with a deadline that only a failure reaches.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_prefix
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile

from css_common.codec import Sample, codec_of
from css_common.component import Component
from css_common.executor import create_executor, retire
from css_common.host import ComponentNode
from css_common.mission import Mission
from css_common.node_process import create_node
from css_common.qos import LOOP_PUBLISHER, RECORDER_SUBSCRIPTION

DEADLINE = 200.0
"""Wall time [s] after which a condition is taken for one that never comes; a loaded machine takes its time."""


def installed(package: str, executable: str) -> Path:
    """File that `ros2 run` starts, which does not exist where the package has no such node or command."""
    return Path(get_package_prefix(package)) / "lib" / package / executable


class Bench:
    """Nodes of a small graph in this process, in a ROS context of their own. Use as a context manager."""

    def __init__(self, executor: str | None = None) -> None:
        """Starts a context.

        Args:
            executor: kind of executor, see `create_executor`.
        """
        self.context = Context()
        self.context.init()
        self.executor = create_executor(executor, self.context)
        self.node = Node("bench", context=self.context, use_global_arguments=False)
        self.executor.add_node(self.node)
        self.logs: list[str] = []
        self._nodes: list[Node] = [self.node]
        self._publishers: dict[str, Publisher] = {}
        everything = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(Log, "/rosout", self._note_log, everything)

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_: object) -> None:
        for node in reversed(self._nodes):
            retire(self.executor, node)
        self.executor.shutdown()
        self.context.try_shutdown()

    def add(self, node: Node) -> None:
        """Runs a node of any kind, to the end of the bench."""
        self._nodes.append(node)
        self.executor.add_node(node)

    def remove(self, node: Node) -> None:
        """Destroys a node at once, as if its process had ended."""
        self._nodes.remove(node)
        retire(self.executor, node)

    def host(self, component: type[Component], mission: Mission, name: str, *, start: bool = True) -> ComponentNode:
        """A component in its node, configured and active unless `start` is False."""
        node = create_node(component, name, mission, context=self.context, use_global_arguments=False)
        self.add(node)
        if start:
            assert node.start(), f"{name} did not start: {self.logs}"
        return node

    def host_all(self, mission: Mission) -> dict[str, ComponentNode]:
        """All nodes of a mission by name, the plant started last."""
        order = sorted(mission.nodes, key=lambda node: node is mission.plant)
        return {node.name: self.host(node.component, mission, node.name) for node in order}

    def _note_log(self, log: Log) -> None:
        self.logs.append(log.msg)

    def publish(self, topic: str, message_type: type, sample: Sample | bytes, *, listened_to: bool = True) -> None:
        """Publishes a message, or bytes that should be one; unless told otherwise, once the topic has a listener."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            publisher = self._publishers[topic] = self.node.create_publisher(message_type, topic, LOOP_PUBLISHER)
        if listened_to and publisher.get_subscription_count() == 0:
            self.until(lambda: publisher.get_subscription_count() > 0, f"{topic} has a listener")
        publisher.publish(sample if isinstance(sample, bytes) else codec_of(message_type).encode(sample))

    def listen(self, topic: str, message_type: type) -> list[Sample]:
        """Messages of a topic from now on, in a list that grows."""
        received: list[Sample] = []
        codec = codec_of(message_type)

        def take(data: Any) -> None:
            received.append(codec.decode(data))

        self.node.create_subscription(message_type, topic, take, RECORDER_SUBSCRIPTION, raw=True)
        return received

    def request(self, service_type: type, name: str, request: Any) -> Any:
        """What a service answers."""
        client = self.node.create_client(service_type, name)
        self.until(client.service_is_ready, f"service {name} is there")
        future = client.call_async(request)
        self.until(future.done, f"service {name} answers")
        self.node.destroy_client(client)
        return future.result()

    def logged(self, text: str) -> int:
        """Number of log lines so far that hold a text."""
        return sum(text in line for line in self.logs)

    def until(self, condition: Callable[[], Any], what: str, seconds: float = DEADLINE) -> None:
        """Runs callbacks until a condition holds.

        Raises:
            AssertionError: it does not come to hold; names it.
        """
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"never came to be: {what}; log: {self.logs}"
            self.executor.spin_once(timeout_sec=0.01)
