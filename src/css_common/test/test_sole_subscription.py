# SPDX-License-Identifier: Apache-2.0
"""A subscription of the real middleware hears one writer, whatever others do."""

from functools import partial

import pytest
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import Int64, String

from css_common.qos import LOOP_PUBLISHER, LOOP_SUBSCRIPTION
from css_common.sole_subscription import SoleSubscription
from css_common.writers import WriterChoice

TOPIC = "numbers"


class Listener:
    """A node that hears numbers from one writer, and nodes that send some."""

    def __init__(self, bench, choice: WriterChoice) -> None:
        self.bench = bench
        self.heard: list[int] = []
        self.hand_overs: list[int] = []
        self.node = self._node("listener")
        self.subscription = SoleSubscription(
            self.node,
            Int64,
            TOPIC,
            lambda data: self.heard.append(deserialize_message(data, Int64).data),
            LOOP_SUBSCRIPTION,
            choice,
            on_hand_over=lambda: self.hand_overs.append(len(self.heard)),
        )
        self._nodes: dict[str, Node] = {}

    def _node(self, name: str) -> Node:
        node = Node(name, context=self.bench.context, use_global_arguments=False)
        self.bench.add(node)
        return node

    def sender(self, name: str, qos: QoSProfile = LOOP_PUBLISHER):
        """A publisher of a node of that name."""
        if name not in self._nodes:
            self._nodes[name] = self._node(name)
        return self._nodes[name].create_publisher(Int64, TOPIC, qos)

    def end(self, name: str, publisher) -> None:
        """Gives up a publisher of that node."""
        self._nodes[name].destroy_publisher(publisher)

    def matched(self, count: int) -> None:
        """Waits until so many writers are there, and are known."""
        self.bench.until(lambda: self.subscription.publisher_count == count, f"{count} writers are matched")
        self.bench.until(lambda: self.writers_known == count, f"{count} writers are known")

    @property
    def writers_known(self) -> int:
        """Writers that the subscription has taken note of."""
        choice = self.subscription._choice
        return len(choice.strangers) + (choice.accepted is not None)

    def until_heard(self, *numbers: int) -> None:
        """Waits until exactly these were heard."""
        self.bench.until(lambda: len(self.heard) >= len(numbers), f"{len(numbers)} messages")
        assert self.heard == list(numbers)

    def until_refused(self, node: str, count: int) -> None:
        """Waits until so many messages of a node were left out."""
        self.bench.until(lambda: self.subscription.refused[node] >= count, f"{count} messages of {node} refused")
        assert self.subscription.refused[node] == count


@pytest.fixture
def listen(bench):
    """Makes listeners."""
    made = []

    def make(choice: WriterChoice) -> Listener:
        made.append(Listener(bench, choice))
        return made[-1]

    yield make
    for listener in made:
        listener.subscription.destroy()


@pytest.fixture
def listener(listen):
    """Hears the first writer."""
    return listen(WriterChoice("/ours"))


def send(publisher, *numbers: int) -> None:
    """Publishes numbers."""
    for number in numbers:
        publisher.publish(Int64(data=number))


def test_messages_of_the_first_writer_are_heard_those_before_matching_too(listener):
    ours = listener.sender("ours")
    send(ours, 1, 2)
    listener.until_heard(1, 2)
    send(ours, 3)
    listener.until_heard(1, 2, 3)
    assert not listener.subscription.refused


def test_second_writer_is_left_out_counted_and_named_and_the_first_goes_on(listener):
    ours = listener.sender("ours")
    send(ours, 1)
    listener.until_heard(1)
    stranger = listener.sender("stranger")
    for k in range(2, 100):
        send(stranger, 1000 + k)
        send(ours, k)
    listener.until_heard(*range(1, 100))
    listener.until_refused("/stranger", 98)
    assert sum("/stranger writes it too" in line for line in listener.bench.logs) == 1


def test_history_of_a_stranger_is_left_out(listener):
    ours = listener.sender("ours")
    listener.matched(1)
    stranger = listener.sender("stranger")
    send(stranger, *range(1000, 1050))
    listener.until_refused("/stranger", 50)
    send(ours, 1)
    listener.until_heard(1)


def test_stranger_that_has_left_leaves_no_trace(listener):
    ours = listener.sender("ours")
    send(ours, 1)
    stranger = listener.sender("stranger")
    listener.matched(2)
    send(stranger, 1000)
    send(ours, 2)
    listener.until_heard(1, 2)
    listener.until_refused("/stranger", 1)
    listener.end("stranger", stranger)
    listener.matched(1)
    send(ours, *range(3, 40))
    listener.until_heard(*range(1, 40))
    assert listener.subscription._timer is None, "messages come by the executor again"


def test_writer_of_the_graph_is_heard_though_others_were_first(listen):
    listener = listen(WriterChoice("/ours", only=True))
    stranger = listener.sender("stranger")
    send(stranger, 1000, 1001)
    listener.until_refused("/stranger", 2)
    ours = listener.sender("ours")
    send(ours, 1, 2)
    send(stranger, 1002)
    listener.until_heard(1, 2)
    listener.until_refused("/stranger", 3)


def test_next_writer_is_announced_when_the_one_before_is_gone(listener):
    first = listener.sender("ours")
    send(first, 1, 2)
    listener.until_heard(1, 2)
    listener.end("ours", first)
    listener.bench.until(lambda: listener.subscription.publisher_count == 0, "the writer is gone")
    second = listener.sender("ours")
    send(second, 3)
    listener.until_heard(1, 2, 3)
    assert listener.hand_overs == [2]


@pytest.mark.parametrize("reliability", [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_driver_that_offers_less_is_heard_and_the_exact_override_is_named(listener, reliability):
    qos = QoSProfile(depth=10, reliability=reliability, durability=DurabilityPolicy.VOLATILE)
    driver = listener.sender("driver", qos)
    listener.matched(1)
    send(driver, 7)
    listener.until_heard(7)
    assert any(
        "qos_overrides./numbers.subscription.durability: volatile" in line and reliability.short_key in line
        for line in listener.bench.logs
    )


def test_stranger_that_offers_less_changes_nothing(listener):
    ours = listener.sender("ours")
    send(ours, 1)
    listener.until_heard(1)
    weak = listener.sender("stranger", QoSProfile(depth=10))
    send(weak, 1000)
    send(ours, 2)
    listener.until_heard(1, 2)
    assert listener.subscription._qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_ended_subscription_hears_nothing_in_either_state(listener):
    ours, stranger = listener.sender("ours"), listener.sender("stranger")
    listener.matched(2)
    send(ours, 1)
    send(stranger, 1000)
    listener.until_heard(1)
    listener.subscription.destroy()
    send(ours, 2)
    listener.bench.until(lambda: ours.get_subscription_count() == 0, "nobody listens")
    assert listener.heard == [1]


def test_successor_whose_predecessor_is_forgotten_late_loses_nothing(listener):
    old = listener.sender("ours")
    send(old, 1)
    listener.until_heard(1)
    new = listener.sender("ours")
    send(new, 2, 3)
    listener.until_refused("/ours", 2)
    listener.end("ours", old)
    send(new, 4)
    listener.until_heard(1, 2, 3, 4)
    assert listener.hand_overs == [1]
    assert not listener.subscription.refused


def test_topics_of_different_types_have_strangers_at_once(bench):
    node, stranger, ours = (
        Node(name, context=bench.context, use_global_arguments=False) for name in ("listener", "stranger", "ours")
    )
    for made in (node, stranger, ours):
        bench.add(made)
    heard: list[object] = []
    topics = {"numbers": (Int64, Int64(data=1)), "words": (String, String(data="one"))}
    subscriptions = []
    for topic, (kind, _) in topics.items():
        take = partial(_append_decoded, heard, kind)
        subscriptions.append(SoleSubscription(node, kind, topic, take, LOOP_SUBSCRIPTION, WriterChoice("/ours")))
    publishers = {topic: ours.create_publisher(kind, topic, LOOP_PUBLISHER) for topic, (kind, _) in topics.items()}
    for topic, (_, message) in topics.items():
        publishers[topic].publish(message)
    bench.until(lambda: len(heard) == 2, "both are heard")
    for topic, (kind, message) in topics.items():
        stranger.create_publisher(kind, topic, LOOP_PUBLISHER).publish(message)
    bench.until(lambda: all(s.refused["/stranger"] == 1 for s in subscriptions), "both strangers are refused")
    for subscription in subscriptions:
        subscription.destroy()
    assert sorted(map(str, heard)) == ["1", "one"]


def _append_decoded(heard: list[object], kind: type, data: bytes) -> None:
    heard.append(deserialize_message(data, kind).data)


def test_writer_that_is_matched_before_it_is_listed_is_not_mistaken_for_the_one_heard(listener, monkeypatch):
    ours = listener.sender("ours")
    send(ours, 1)
    listener.until_heard(1)
    listed = listener.subscription._present
    monkeypatch.setattr(listener.subscription, "_present", lambda: [w for w in listed() if w.node == "/ours"])
    stranger = listener.sender("stranger")
    listener.bench.until(lambda: listener.subscription.publisher_count == 2, "the stranger is matched")
    send(stranger, 1000)
    send(ours, 2)
    listener.until_heard(1, 2)
    monkeypatch.undo()
    listener.matched(2)
    send(stranger, 1001)
    listener.until_refused("/stranger", 1)
