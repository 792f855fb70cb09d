# SPDX-License-Identifier: Apache-2.0
"""Messages and recordings that the tests share. Messages are serialised by `rosbags`, not by Sunpoint."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap_doctor import doctor as doctor
from rclpy.context import Context
from rclpy.node import Node
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from css_common.executor import create_executor, retire
from css_common.testing import DEADLINE
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter
from css_recording.schemas import dependencies, schema_of

EPOCH_NS = 1_363_000_000_000_000_000  # March 2013
VOLTAGES = Topic("/css/voltages", "css_msgs/msg/CssVoltages")
IMU = Topic("/gyro/imu", "sensor_msgs/msg/Imu")
TORQUE = Topic("/wheels/torque_command", "css_msgs/msg/WheelTorqueCommand")


class Flight:
    """A made-up flight: three topics at 10 Hz."""

    topics = (VOLTAGES, IMU, TORQUE)

    def __init__(self, typestore: Typestore) -> None:
        self.typestore = typestore

    def message(self, topic: Topic, step: int) -> tuple[str, int, bytes]:
        """Topic, stamp and bytes of one message; its values tell which step it belongs to."""
        stamp_ns = EPOCH_NS + step * 100_000_000
        types = self.typestore.types
        stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="body")
        vector = types["geometry_msgs/msg/Vector3"]
        if topic.type == VOLTAGES.type:
            values = np.linspace(0.0, 1.0, 8) * step
            message = types[topic.type](header=header, saturated=step & 0xFF, voltages=values)
        elif topic.type == TORQUE.type:
            message = types[topic.type](header=header, saturated=0, torque=np.full(4, 1e-3 * step))
        else:
            message = types[topic.type](
                header=header,
                orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                orientation_covariance=np.full(9, -1.0),
                angular_velocity=vector(x=1e-3 * step, y=0.0, z=-1e-3 * step),
                angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector(x=0.0, y=0.0, z=0.0),
                linear_acceleration_covariance=np.full(9, -1.0),
            )
        return topic.name, stamp_ns, bytes(self.typestore.serialize_cdr(message, topic.type))

    def messages(self, steps: int, first: int = 0) -> list[tuple[str, int, bytes]]:
        """All messages of some steps, in the order in which a recording stores them."""
        return [self.message(topic, step) for step in range(first, first + steps) for topic in self.topics]

    def record(self, folder: Path, steps: int, **options: object) -> Path:
        """Write a finished recording."""
        with BagWriter(folder, self.topics, {"mission": "name: test\n"}, **options) as writer:  # type: ignore
            for message in self.messages(steps):
                writer.write(*message)
        return folder


def typestore_of(type_names: list[str]) -> Typestore:
    """A `rosbags` type store with the installed definitions of some types and all they are made of."""
    store = get_typestore(Stores.EMPTY)
    waiting, types = list(type_names), {}
    while waiting:
        name = waiting.pop()
        if name not in types:
            text = schema_of(name).text.split("=" * 80)[0]
            types.update(get_types_from_msg(text, name))
            waiting += dependencies(name, text)
    store.register(types)
    return store


@pytest.fixture(scope="session")
def flight() -> Flight:
    """The made-up flight."""
    return Flight(typestore_of([topic.type for topic in Flight.topics]))


class Graph:
    """A ROS context with an executor, and nodes that go with it."""

    def __init__(self) -> None:
        self.context = Context()
        self.context.init()
        self.executor = create_executor(context=self.context)
        self.options = {"context": self.context, "use_global_arguments": False}
        self.nodes: list[Node] = []

    def add(self, node):
        """Put a node into the executor."""
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def node(self, name: str) -> Node:
        """A plain node."""
        return self.add(Node(name, **self.options))

    def spin_until(self, condition: Callable[[], bool], limit: float = DEADLINE) -> None:
        """Run callbacks until something is so."""
        end = time.monotonic() + limit
        while not condition():
            assert time.monotonic() < end, "it never came to pass"
            self.executor.spin_once(timeout_sec=0.02)

    def close(self) -> None:
        """Take everything down."""
        for node in self.nodes:
            retire(self.executor, node)
        self.executor.shutdown()
        self.context.try_shutdown()


@pytest.fixture
def graph() -> Iterator[Graph]:
    """An empty graph."""
    graph = Graph()
    yield graph
    graph.close()
