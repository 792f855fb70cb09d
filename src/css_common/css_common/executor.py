# SPDX-License-Identifier: Apache-2.0
"""The executor of every Sunpoint process.

rclpy's EventsExecutor is several times faster than SingleThreadedExecutor but experimental, and its `spin()` runs no
callback in Jazzy while `spin_once()` works: it is used through `spin_until` and `spin_about_until` alone.
`DrainingExecutor` is the fallback (environment variable SUNPOINT_EXECUTOR=draining): a SingleThreadedExecutor that
empties each ready queue before it builds its wait set anew, which is what costs rclpy most of its time.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import get_default_context

from css_common.ros_internals import InvalidHandle, RCLError

_CALLBACKS_BETWEEN_CHECKS = 64
_MESSAGES_IN_A_ROW = 200


class DrainingExecutor(SingleThreadedExecutor):
    """Takes messages until every subscription is empty, then waits for whatever comes first.

    Where nodes of one process answer each other there is always another message: after `_MESSAGES_IN_A_ROW` it is the
    turn of timers and services.
    """

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Delivers waiting messages and runs one other callback; waits for it only when there were none."""
        if self._drain():
            timeout_sec = 0.0
        super().spin_once(timeout_sec)

    def _drain(self) -> int:
        taken, before = 0, -1
        while before < taken < _MESSAGES_IN_A_ROW:
            before = taken
            for node in self.get_nodes():
                for subscription in node.subscriptions:
                    # an event waits for the end of this; a second writer must be known before its first message
                    getattr(subscription, "before_taking", _nothing)()
                    with subscription.handle:
                        message = subscription.handle.take_message(subscription.msg_type, subscription.raw)
                    if message is not None:
                        taken += 1
                        subscription.callback(message[0])
        return taken


def _nothing() -> None:
    """There is nothing to do."""


def create_executor(kind: str | None = None, context: Context | None = None) -> Executor:
    """An executor.

    Args:
        kind: `events` or `draining`; None takes SUNPOINT_EXECUTOR, or `events`.
        context: ROS context; None is the default one.

    Raises:
        ValueError: another word.
    """
    kind = kind or os.environ.get("SUNPOINT_EXECUTOR") or "events"
    if kind == "events":
        return EventsExecutor(context=context)
    if kind == "draining":
        return DrainingExecutor(context=context)
    raise ValueError(f"SUNPOINT_EXECUTOR: {kind!r} given, expected events or draining")


def retire(executor: Executor, node: Node) -> None:
    """Destroys a node and takes it out of its executor.

    Subscriptions go first: with several writers of a topic the executor does not see the true one.
    """
    stop_listening = getattr(node, "stop_listening", None)
    if stop_listening is not None:
        stop_listening()
    executor.remove_node(node)
    node.destroy_node()


@contextmanager
def executor_with(node: Node) -> Iterator[Executor]:
    """An executor that runs one node; at the end both are given up.

    An executor that is left behind is one into which threads of the middleware call while Python takes itself apart.
    """
    executor = create_executor(None, node.context)
    executor.add_node(node)
    try:
        yield executor
    finally:
        retire(executor, node)
        executor.shutdown()


def spin_until(
    executor: Executor, done: Callable[[], bool], interval: float = 0.05, context: Context | None = None
) -> None:
    """Runs callbacks until `done()`, which is asked after each callback and at least every `interval` seconds.

    Raises:
        ExternalShutdownException: the ROS context was shut down from elsewhere.
    """
    _spin(lambda timeout_sec: executor.spin_once(timeout_sec=timeout_sec), done, interval, context)


def _spin(spin: Callable[[float], None], done: Callable[[], bool], interval: float, context: Context | None) -> None:
    context = context or get_default_context()
    while True:
        if not context.ok():
            raise ExternalShutdownException
        try:
            for _ in range(_CALLBACKS_BETWEEN_CHECKS):
                if done():
                    return
                spin(interval)
        except InvalidHandle:
            pass  # something was destroyed while an event of it was in the executor's queue
        except RCLError:
            # what a shutdown in the middle of a wait looks like from inside
            if context.ok():
                raise


def spin_about_until(executor: Executor, done: Callable[[], bool], node: Node, interval: float = 0.01) -> None:
    """As `spin_until`, but `done()` is asked about every `interval` seconds alone, and what comes until then runs.

    An EventsExecutor then goes from callback to callback by itself, which spares a tenth of the time of a flight. As it
    looks at a limit of time only when it has nothing to do, a timer ends its run.

    Args:
        executor: of the node.
        done: the condition.
        node: has the timer meanwhile.
        interval: see above.
    """
    if isinstance(executor, SingleThreadedExecutor):
        spin_until(executor, done, interval, node.context)
        return
    pause = Future()

    def spin(timeout_sec: float) -> None:
        nonlocal pause
        pause = Future()
        executor.spin_until_future_complete(pause, timeout_sec)

    timer = node.create_timer(interval, lambda: pause.set_result(None), clock=Clock(clock_type=ClockType.STEADY_TIME))
    try:
        _spin(spin, done, interval, node.context)
    finally:
        node.destroy_timer(timer)
