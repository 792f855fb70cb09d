# SPDX-License-Identifier: Apache-2.0
"""Both executors: messages, timers and services all get their turn, and errors come out."""

import pytest
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64, Int64
from std_srvs.srv import Trigger

from css_common.executor import DrainingExecutor, create_executor, executor_with, spin_about_until, spin_until
from css_common.ros_internals import InvalidHandle


def test_kinds(bench, monkeypatch):
    monkeypatch.delenv("SUNPOINT_EXECUTOR", raising=False)
    assert type(create_executor(context=bench.context)).__name__ == "EventsExecutor"
    assert isinstance(create_executor("draining", bench.context), DrainingExecutor)
    monkeypatch.setenv("SUNPOINT_EXECUTOR", "draining")
    assert isinstance(create_executor(context=bench.context), DrainingExecutor)
    assert type(create_executor("events", bench.context)).__name__ == "EventsExecutor"
    monkeypatch.setenv("SUNPOINT_EXECUTOR", "fast")
    with pytest.raises(ValueError, match="SUNPOINT_EXECUTOR: 'fast' given, expected events or draining"):
        create_executor(context=bench.context)


def test_timers_and_services_get_their_turn_in_an_endless_exchange_of_messages(bench):
    # two topics that answer each other for ever, as plant and control do in one process
    node = bench.node
    publishers = {name: node.create_publisher(Int64, name, 10) for name in ("ping", "pong")}
    passes: list[int] = []

    def hand_on(to: str):
        def callback(message: Int64) -> None:
            passes.append(message.data)
            publishers[to].publish(Int64(data=message.data + 1))

        return callback

    node.create_subscription(Int64, "ping", hand_on("pong"), 10)
    node.create_subscription(Int64, "pong", hand_on("ping"), 10)
    ticks: list[int] = []
    node.create_timer(0.001, lambda: ticks.append(len(passes)))
    asked: list[int] = []

    def answer(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        asked.append(len(passes))
        return response

    node.create_service(Trigger, "ask", answer)
    bench.until(lambda: publishers["ping"].get_subscription_count() == 1, "the topics are connected")
    publishers["ping"].publish(Int64(data=0))
    bench.until(lambda: len(passes) > 10, "the exchange runs")
    bench.request(Trigger, "ask", Trigger.Request())
    bench.until(lambda: len(ticks) > 5, "the timer ticks")
    assert asked
    assert passes == list(range(len(passes))), "no message lost, none out of order"


def test_the_condition_is_asked_while_messages_never_end(bench):
    node = bench.node
    publisher = node.create_publisher(Int64, "to_itself", 10)
    passes: list[int] = []

    def hand_on(message: Int64) -> None:
        passes.append(message.data)
        publisher.publish(Int64(data=message.data + 1))

    node.create_subscription(Int64, "to_itself", hand_on, 10)
    bench.until(lambda: publisher.get_subscription_count() == 1, "the topic is connected")
    publisher.publish(Int64(data=0))
    asked: list[int] = []

    def seen_often() -> bool:
        asked.append(len(passes))
        return len(asked) > 5

    timers = len(list(node.timers))
    spin_about_until(bench.executor, seen_often, node, interval=0.002)
    assert asked[-1] > asked[0], "messages pass meanwhile"
    assert len(list(node.timers)) == timers
    bench.node.create_timer(0.01, bench.context.shutdown)
    with pytest.raises(ExternalShutdownException):
        spin_about_until(bench.executor, lambda: False, node, interval=0.002)


def test_an_executor_with_one_node_is_given_up_with_it():
    context = Context()
    context.init()
    node = Node("short_lived", context=context, use_global_arguments=False)
    heard: list = []
    node.create_subscription(Float64, "echo", heard.append, 10)
    publisher = node.create_publisher(Float64, "echo", 10)
    with executor_with(node) as executor:
        spin_until(executor, lambda: publisher.get_subscription_count() == 1, context=context)
        publisher.publish(Float64(data=1.0))
        spin_until(executor, lambda: bool(heard), context=context)
    with pytest.raises(InvalidHandle), node.handle:
        pass
    with pytest.raises(InvalidHandle), publisher.handle:
        pass
    context.try_shutdown()


def test_messages_of_many_topics_arrive_in_the_order_of_each(bench):
    received: dict[str, list[float]] = {}
    publishers = {}
    for name in ("a", "b", "c"):
        received[name] = []
        bench.node.create_subscription(Float64, name, lambda m, n=name: received[n].append(m.data), 100)
        publishers[name] = bench.node.create_publisher(Float64, name, 100)
    bench.until(lambda: all(p.get_subscription_count() for p in publishers.values()), "the topics are connected")
    for k in range(50):
        for publisher in publishers.values():
            publisher.publish(Float64(data=float(k)))
    bench.until(lambda: all(len(r) == 50 for r in received.values()), "all messages")
    assert all(values == [float(k) for k in range(50)] for values in received.values())


def test_exception_of_a_callback_comes_out(bench):
    def fail() -> None:
        raise ZeroDivisionError("on demand")

    timer = bench.node.create_timer(0.001, fail)
    with pytest.raises(ZeroDivisionError, match="on demand"):
        bench.until(lambda: False, "the timer fires")
    timer.cancel()


def test_spinning_ends_at_the_condition_and_at_a_shutdown_from_elsewhere(bench):
    count = iter(range(1000))
    spin_until(bench.executor, lambda: next(count) >= 3, interval=0.001, context=bench.context)
    assert next(count) == 4
    timer = bench.node.create_timer(0.01, bench.context.shutdown)
    with pytest.raises(ExternalShutdownException):
        spin_until(bench.executor, lambda: False, interval=0.001, context=bench.context)
    timer.cancel()
