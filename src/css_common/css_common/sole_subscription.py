# SPDX-License-Identifier: Apache-2.0
"""A subscription that hears one writer of its topic, whoever else speaks on it.

rclpy does not tell who wrote a message. While a topic has one writer the executor takes its messages as ever. As soon
as the middleware announces a second one, before anything of it is taken, the executor is given an empty handle in the
place of this subscription's, and messages are taken here, by a timer, with the GID of their writer, until there is
one writer again. The same is done at the start, until it is known who the first one is.

"""

import copy
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from rclpy.topic_endpoint_info import TopicEndpointInfo

from css_common.edge import HISTORY
from css_common.qos import matching_qos
from css_common.raw_take import take_with_writer
from css_common.ros_internals import (
    InvalidHandle,
    bare_subscription,
    event_of,
    overrides_of,
    show_executor,
    subscriptions_of,
    wake_executor_of,
)
from css_common.writers import Writer, WriterChoice

_TAKE_EVERY = 0.001
_LOOK_AGAIN_AFTER = 100  # takes
_NAMELESS = "a node without a name"
_UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
_NOBODYS_TOPIC = "/_nobody"  # hidden, and nobody writes below it


class SoleSubscription:
    """Hears one writer of a topic.

    Attributes:
        refused: messages left out because another writer than the accepted one sent them, by node.
        handed_over: how often another writer took the place of one that was gone.
    """

    def __init__(
        self,
        node: Node,
        message_type: type,
        topic: str,
        callback: Callable[[bytes], None],
        qos: QoSProfile,
        choice: WriterChoice,
        *,
        overriding: QoSOverridingOptions | None = None,
        on_hand_over: Callable[[], object] = lambda: None,
    ) -> None:
        """Subscribes.

        Args:
            node: on whose behalf.
            message_type: ROS message class.
            topic: topic name, relative or not.
            callback: takes each serialised message of the accepted writer.
            qos: quality of service; adapted to the first writer when that offers less.
            choice: who may speak.
            overriding: policies that parameters `qos_overrides...` may set; then these stay as they are.
            on_hand_over: called before the first message of a writer that took over.
        """
        self.topic = node.resolve_topic_name(topic)
        self.refused: Counter[str] = Counter()
        self.handed_over = 0
        self._node = node
        self._type = message_type
        self._callback = callback
        self._choice = choice
        self._on_hand_over = on_hand_over
        self._named: set[Writer] = set()
        self._kept: dict[bytes, deque[bytes]] = {}
        self._nobody: Any = None
        self._timer: Timer | None = None
        self._takes = 0
        self._ended = False
        self._matched = (0, 0)
        self._unlisted = False
        # rclpy writes overrides into the profile that it is given
        self._subscription = self._subscribe(copy.copy(qos), overriding)

    @property
    def publisher_count(self) -> int:
        """Writers that are matched now."""
        handle = self._handle
        with handle:
            return handle.get_publisher_count()

    def destroy(self) -> None:
        """Ends the subscription; again does nothing."""
        if self._ended:
            return
        self._ended = True
        self._stop_taking()
        self._give_to_executor()  # which must see the true handle to let go of it
        self._node.destroy_subscription(self._subscription)
        if self._nobody is not None:
            self._nobody.destroy_when_not_in_use()
            self._nobody = None

    def _subscribe(self, qos: QoSProfile, overriding: QoSOverridingOptions | None) -> Subscription:
        events = SubscriptionEventCallbacks(matched=_nothing, incompatible_qos=self._on_incompatible)
        subscription = self._node.create_subscription(
            self._type,
            self.topic,
            self._callback,
            qos,
            raw=True,
            event_callbacks=events,
            qos_overriding_options=overriding,
        )
        self._qos = qos
        self._overridden = overriding is not None and self._has_override()
        self._handle = subscription.handle
        self._hear_of_writers_at_once(subscription)
        # not yet the executor's: nothing is taken before its writer is known
        subscriptions_of(self._node).remove(subscription)
        return subscription

    # Writers that come and go

    def _hear_of_writers_at_once(self, subscription: Subscription) -> None:
        """Looks when the middleware's event is taken.

        What an executor calls for an event stands at the end of its queue, behind messages of the new writer.
        """
        handlers = list(subscription.event_handlers)  # type: ignore[call-overload]  # declared as one, is a list
        (handler,) = (h for h in handlers if h.event_type == QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED)
        take = handler.take_data

        def take_and_look() -> object:
            try:
                taken = take()
            except InvalidHandle:  # the event was under way when the subscription was given up
                return None
            self._look()
            return taken

        def look_when_matched() -> None:
            event = event_of(handler)
            with event:
                status = event.take_event()
            counts = (status.total_count, status.current_count) if status is not None else self._matched
            if counts != self._matched:
                self._matched = counts
                self._look()

        handler.take_data = take_and_look
        # for the executor that takes all messages before any event
        subscription.before_taking = look_when_matched  # type: ignore[attr-defined]

    def _look(self) -> None:
        if self._ended:
            return
        present = self._present()
        # the middleware matches a writer in one thread and lists it in another
        self._unlisted = self.publisher_count > len(present)
        if self._choice.update(present):
            self.handed_over += 1
            self._report(f"{self.topic}: {self._name(self._choice.accepted)} took over")
            self._on_hand_over()
            self._hear_kept()
        self._name_strangers()
        somebody = self._choice.accepted is not None
        others = bool(self._choice.strangers) or self._unlisted
        if somebody and not others:
            self._take_waiting()
            self._stop_taking()
            self._give_to_executor()
        elif somebody or others:
            self._take_from_executor()
            self._start_taking()

    def _present(self) -> list[Writer]:
        return writers_of(self._node, self.topic, self._qos)

    @property
    def _undecided(self) -> bool:
        """Somebody who is not known yet may be the one to hear."""
        return self._choice.undecided or (self._choice.accepted is None and self._unlisted)

    def _name_strangers(self) -> None:
        for stranger in self._choice.strangers:
            if stranger.node and stranger not in self._named and not self._choice.undecided:
                self._named.add(stranger)
                heard = self._name(self._choice.accepted)
                self._node.get_logger().error(
                    f"{self.topic}: {stranger.node} writes it too; only {heard} is heard, messages of others are "
                    "counted and left out"
                )

    @staticmethod
    def _name(writer: Writer | None) -> str:
        return (writer.node or _NAMELESS) if writer is not None else "the node that the mission names"

    def _report(self, text: str) -> None:
        self._node.get_logger().info(text)

    # Taking with the writer's name

    def _start_taking(self) -> None:
        if self._timer is None:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = self._node.create_timer(_TAKE_EVERY, self._take_and_look, clock=steady)

    def _stop_taking(self) -> None:
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _take_and_look(self) -> None:
        if self._timer is None:  # a firing that was under way when it was destroyed
            return
        self._takes += 1
        if self._takes % _LOOK_AGAIN_AFTER == 0:
            self._look()  # names become known, processes end
        self._take_waiting()

    def _take_waiting(self) -> None:
        while not self._undecided:
            taken = take_with_writer(self._handle)
            if taken is None:
                return
            data, gid = taken
            accepted = self._choice.accepted
            if accepted is not None and gid == accepted.gid:
                self._callback(data)
            else:
                self._refuse(data, gid)

    def _refuse(self, data: bytes, gid: bytes) -> None:
        node = next((w.node for w in (*self._choice.strangers, *self._named) if w.gid == gid), "")
        self.refused[node or _NAMELESS] += 1
        if self._choice.accepted is not None and node and node == self._choice.accepted.node:
            # perhaps a node that was restarted where its old process cannot be seen
            self._kept.setdefault(gid, deque(maxlen=HISTORY)).append(data)

    def _hear_kept(self) -> None:
        accepted = self._choice.accepted
        kept = self._kept.pop(accepted.gid, ()) if accepted is not None else ()
        self._kept.clear()
        for data in kept:
            self.refused[accepted.node] -= 1  # type: ignore[union-attr]
            self._callback(data)
        self.refused = +self.refused

    # The executor's share

    def _give_to_executor(self) -> None:
        show_executor(self._subscription, self._handle)
        if self._subscription not in subscriptions_of(self._node):
            subscriptions_of(self._node).append(self._subscription)
            wake_executor_of(self._node)

    def _take_from_executor(self) -> None:
        if self._subscription not in subscriptions_of(self._node):
            return  # it was never the executor's
        if self._nobody is None:
            # a topic of one type has no reader of another, so each has a name of its own
            self._nobody = bare_subscription(self._node, self._type, f"{_NOBODYS_TOPIC}{self.topic}", self._qos)
        show_executor(self._subscription, self._nobody)

    # Quality of service

    def _has_override(self) -> bool:
        prefix = f"qos_overrides.{self.topic}.subscription."
        return any(name.startswith(prefix) for name in overrides_of(self._node))

    def _on_incompatible(self, _: object) -> None:
        """Makes do with what the writer offers, unless somebody is heard already or parameters say otherwise."""
        publishers = self._node.get_publishers_info_by_topic(self.topic)
        offers = [found for found in publishers if self._choice.admits(_node_name(found))]
        if self._choice.accepted is not None or not offers:
            return
        adapted = matching_qos(offers, self._qos.depth)
        advice = (
            f"qos_overrides.{self.topic}.subscription.durability: {adapted.durability.short_key}, "
            f"qos_overrides.{self.topic}.subscription.reliability: {adapted.reliability.short_key}"
        )
        names = ", ".join(sorted({_node_name(found) or _NAMELESS for found in offers}))
        if self._overridden:
            self._node.get_logger().error(f"{self.topic}: {names} offers less than is asked for; set {advice}")
            return
        if (adapted.durability, adapted.reliability) == (self._qos.durability, self._qos.reliability):
            return
        self._node.get_logger().warning(
            f"{self.topic}: {names} offers less than is usual; listening with what it offers, as parameters {advice}"
        )
        self.destroy()
        self._ended = False
        self._subscription = self._subscribe(adapted, None)
        self._look()


def writers_of(node: Node, topic: str, asked: QoSProfile | None = None) -> list[Writer]:
    """Writers of a topic that the middleware knows, of those only that offer what a subscription asks for."""
    return [
        Writer(bytes(found.endpoint_gid), _node_name(found))
        for found in node.get_publishers_info_by_topic(topic)
        if asked is None or qos_check_compatible(found.qos_profile, asked)[0] != QoSCompatibility.ERROR
    ]


def _nothing(_: object) -> None:
    """What there is to do was done when the event was taken."""


def _node_name(found: TopicEndpointInfo) -> str:
    """Fully qualified name of an endpoint's node; empty when the middleware does not know it yet."""
    if not found.node_name or found.node_name == _UNKNOWN_NODE:
        return ""
    return f"{found.node_namespace.rstrip('/')}/{found.node_name}"
