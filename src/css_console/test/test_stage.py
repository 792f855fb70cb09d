# SPDX-License-Identifier: Apache-2.0
"""What browsers are told, and what becomes of their orders, with a graph that is made up."""

import asyncio
import json
from functools import partial

import pytest

from css_console.audience import Audience, Spectator
from css_console.history import History
from css_console.stage import Stage, Subject


@pytest.fixture
def stage(made_up_graph):
    return Stage(made_up_graph(), Subject("a mission", "flight"))


def told(spectator):
    """What a spectator would be sent now, by type."""
    return {message["type"]: message for message in map(json.loads, asyncio.run(spectator.next()))}


def test_the_latest_of_a_kind_takes_the_place_of_the_last():
    async def main():
        audience, spectator = Audience(), Spectator()
        audience.enter(spectator)
        for k in range(1000):
            audience.show("frame", partial(str, k))
            audience.show("nodes", partial("n{}".format, k))
        assert spectator.waiting == 2
        assert await spectator.next() == ["999", "n999"]
        assert spectator.replaced == 1998
        late = Spectator()
        audience.enter(late, [("frame", "999")])
        assert await late.next() == ["999"]
        audience.leave(spectator)
        audience.show("frame", lambda: "1000")
        assert spectator.waiting == 0 and await late.next() == ["1000"]

    asyncio.run(main())


def test_nothing_is_made_while_nobody_watches():
    def made():
        raise AssertionError("nobody sees it")

    Audience().show("frame", made)


def test_answers_are_kept_in_order_but_not_without_end():
    async def main():
        spectator = Spectator()
        for k in range(100):
            spectator.answer(str(k))
        assert await spectator.next() == [str(k) for k in range(36, 100)]

    asyncio.run(main())


def test_an_order_is_performed_once_and_all_see_that_it_was(stage):
    one, other = Spectator(), Spectator()
    for spectator in (one, other):
        stage.welcome(spectator)
        told(spectator)
    stage.take(one, '{"id": 5, "do": "pause"}')
    ((calls, done),) = stage._watcher.performed
    assert [call.service for call in calls] == ["/dynamics/pause"]
    done((True, "paused"))
    answer = told(one)["answer"]
    assert (answer["id"], answer["good"], answer["message"]) == (5, True, "paused")
    log = told(other)
    assert set(log) == {"log"}
    assert log["log"]["log"][0]["commands"] == ["ros2 service call /dynamics/pause std_srvs/srv/Trigger"]


def test_a_dry_order_says_its_command_and_does_nothing(stage):
    spectator = Spectator()
    order = {"do": "inject", "node": "/css_array", "target": "cell.3", "kind": "dead", "duration": 5, "dry": True}
    stage.take(spectator, json.dumps(order))
    assert stage._watcher.performed == []
    (command,) = told(spectator)["answer"]["commands"]
    assert command == (
        "ros2 service call /css_array/inject_fault css_msgs/srv/InjectFault "
        """'{target: "cell.3", kind: "dead", values: [], duration: 5}'"""
    )


def test_orders_that_nobody_answers_do_not_pile_up(stage):
    spectator = Spectator()
    for k in range(20):
        stage.take(spectator, json.dumps({"id": k, "do": "step"}))
    assert len(stage._watcher.performed) == 16
    for _, done in stage._watcher.performed:
        done((True, ""))
    stage.take(spectator, '{"id": 99, "do": "step"}')
    assert len(stage._watcher.performed) == 17


def test_what_the_graph_lacks_is_said(stage):
    spectator = Spectator()
    stage.take(spectator, '{"id": 1, "do": "seek", "time": 3}')
    answer = told(spectator)["answer"]
    assert not answer["good"] and "no node in this graph that plays a recording" in answer["message"]


def test_a_new_flight_brings_its_own_history(stage):
    graph, spectator = stage._watcher, Spectator()
    graph.fly(0.0, 1.0)
    graph.fly(100.0, 2.0)
    stage.look()
    stage.welcome(spectator)
    assert told(spectator)["history"]["columns"] == [[0.0, 100.0], [1.0, 2.0]]
    graph.flights, graph.history = 1, History(1)
    graph.fly(0.0, 7.0)
    stage.look()
    assert told(spectator)["history"]["columns"] == [[0.0], [7.0]]


def test_what_is_held_at_the_beginning_goes_on_with_the_first_browser(made_up_graph):
    graph = made_up_graph()
    stage = Stage(graph, Subject("a mission", "flight"), begins=True)
    graph.inventory = graph.inventory._replace(topics=(("/truth", "css_msgs/msg/SpacecraftState"),))
    graph.fly(0.0, 1.0)
    stage.look()
    assert graph.performed == []
    stage.welcome(Spectator())
    stage.look()
    stage.welcome(Spectator())
    stage.look()
    assert [call.service for calls, _ in graph.performed for call in calls] == ["/dynamics/resume"]


def test_a_recording_begins_before_its_first_message(made_up_graph):
    graph = made_up_graph()
    graph.inventory = graph.inventory._replace(pace="/player", player="/player", director="")
    stage = Stage(graph, Subject("a recording", "recording"), begins=True)
    stage.welcome(Spectator())
    stage.look()
    assert graph.performed == []  # its topics are not known yet
    graph.inventory = graph.inventory._replace(topics=(("/truth", "css_msgs/msg/SpacecraftState"),))
    stage.look()
    assert len(graph.performed) == 1
