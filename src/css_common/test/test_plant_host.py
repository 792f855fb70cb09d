# SPDX-License-Identifier: Apache-2.0
"""The plant and its partners: who is waited for, who may be late, who may be lost, and who may come back."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from presence import present
from testbed.nodes.source import Source

from css_common.codec import codec_of
from css_common.mission import Mission
from css_common.plant_host import PlantNode
from css_common.qos import LOOP_PUBLISHER
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SunEstimate, WheelTorqueCommand

T0 = 1_370_044_800_000_000_000
STEP = 100_000_000


def _has(messages: list[Any], count: int) -> bool:
    return len(messages) == count


def commands(plant: PlantNode) -> list[float | None]:
    """What the plant was told in each of its steps."""
    assert isinstance(plant.component, Source)
    return plant.component.commands


SHORT = ("lockstep.warn_after=0.05", "lockstep.hold_limit=0.2")
PAIR = "graph.nodes=testbed/source,testbed/estimator,testbed/controller"


def host_plant(bench: Bench, mission: Mission) -> PlantNode:
    """The plant of a mission, active."""
    node = bench.host(present(mission.plant).component, mission, present(mission.plant).name)
    assert isinstance(node, PlantNode)
    return node


def host_partners(bench: Bench, mission: Mission) -> dict:
    """Every node but the plant, active."""
    return {n.name: bench.host(n.component, mission, n.name) for n in mission.nodes if n is not mission.plant}


def fly(bench: Bench, mission: Mission) -> dict:
    """A whole mission, flown to its end."""
    nodes = bench.host_all(mission)
    plant = nodes[present(mission.plant).name]
    assert isinstance(plant, PlantNode)
    bench.until(lambda: plant.done, "the flight has ended")
    assert plant.failed == ""
    return nodes


def command(step: int, torque: float = 0.0):
    """A command of a step."""
    return codec_of(WheelTorqueCommand).sample(T0 + step * STEP, "bus", torque=np.array([torque]))


def test_every_step_is_answered_with_its_own_stamp(bench, mission):
    voltages = bench.listen("voltages", CssVoltages)
    nodes = fly(bench, mission("mission.duration=5"))
    plant, estimator = nodes["source"], nodes["estimator"]
    bench.until(lambda: len(voltages) == 50, "all voltages")
    assert [v.stamp_ns for v in voltages] == [T0 + k * STEP for k in range(50)]
    assert commands(plant) == [float(k) for k in range(50)]
    assert [stamp for stamp, _ in estimator.component.cycles] == [T0 + k * STEP for k in range(50)]
    assert all(sample.stamp_ns == stamp for stamp, got in estimator.component.cycles for sample in got.values())
    assert plant.counters == {"cycles": 50}
    assert plant.stamp_ns == T0 + 49 * STEP
    for node in nodes.values():
        assert "unmatched" not in node.health()[2] or node.health()[2]["unmatched"] == 0
        assert not any("rejected" in key for key in node.health()[2])


def test_two_flights_give_the_same_numbers(mission):
    flights = []
    for executor in ("events", "draining"):
        with Bench(executor) as bench:
            estimates = bench.listen("estimator/sun_estimate", SunEstimate)
            fly(bench, mission("mission.duration=3", "lockstep.recorders=0"))
            bench.until(partial(_has, estimates, 30), "all estimates")
            flights.append([codec_of(SunEstimate).encode(e) for e in estimates])
    assert flights[0] == flights[1]


def test_slow_sensors_are_waited_for_when_they_are_due(bench, mission):
    nodes = fly(
        bench,
        mission(
            "graph.nodes=testbed/source,testbed/compass,testbed/estimator,testbed/controller",
            "estimator.use_field=true",
            "estimator.use_gyro=false",
        ),
    )
    cycles = nodes["estimator"].component.cycles
    assert [got["field"] is not None for _, got in cycles] == [k % 4 == 0 for k in range(10)]


def test_awaited_topics_with_dividers_do_not_stop_the_steps_between(bench, mission):
    # nobody answers three steps of four
    nodes = fly(bench, mission("graph.nodes=testbed/source,testbed/compass"))
    assert nodes["source"].counters["cycles"] == 10
    assert nodes["compass"].counters["cycles"] == 10


def test_plant_that_nobody_answers_flies_alone(bench, mission):
    nodes = fly(bench, mission("graph.nodes=testbed/source"))
    assert nodes["source"].component.commands == [None] * 10


def test_plant_begins_only_when_all_partners_are_there(bench, mission):
    m = mission(PAIR, *SHORT)
    voltages = bench.listen("voltages", CssVoltages)
    plant = host_plant(bench, m)
    for node in m.nodes[1:]:
        bench.until(lambda: bench.logged("the flight has not begun"), "the plant says what is absent")
        assert not plant.begun
        assert voltages == []
        bench.host(node.component, m, node.name)
    bench.until(lambda: plant.done, "the flight has ended")
    assert commands(plant) == [float(k) for k in range(10)]
    bench.until(lambda: bench.logged("command has no publisher"), "the log names the command")
    assert bench.logged("voltages has 1 of 1 listeners") == 0


def test_plant_waits_for_recorders(bench, mission):
    m = mission("graph.nodes=testbed/source", "lockstep.recorders=1", *SHORT)
    plant = host_plant(bench, m)
    bench.until(lambda: bench.logged("voltages has 0 of 1 listeners; truth has 0 of 1 listeners"), "it says so")
    assert not plant.begun
    voltages = bench.listen("voltages", CssVoltages)
    bench.listen("truth", m.topics["truth"])
    bench.until(lambda: plant.done and len(voltages) == 10, "every message since the first")


def test_partners_that_never_come_end_the_flight(bench, mission):
    plant = host_plant(bench, mission(PAIR, "lockstep.startup_limit=0.3", *SHORT))
    bench.until(lambda: plant.done, "the plant gives up")
    assert "after 0.3 s still absent: voltages has 0 of 1 listeners; command has no publisher" in plant.failed
    assert not plant.begun


def test_second_publisher_of_the_plants_topics_is_refused(bench, mission):
    m = mission(PAIR, *SHORT)
    rival = bench.node.create_publisher(CssVoltages, "voltages", LOOP_PUBLISHER)
    host_partners(bench, m)
    plant = host_plant(bench, m)
    bench.until(lambda: plant.done, "the plant refuses")
    assert "another node publishes voltages" in plant.failed
    assert "ROS_DOMAIN_ID" in plant.failed
    assert not plant.begun
    bench.node.destroy_publisher(rival)


def test_flight_that_has_just_ended_may_still_be_leaving(bench, mission):
    m = mission(PAIR, "lockstep.warn_after=20")
    leaving = bench.node.create_publisher(CssVoltages, "voltages", LOOP_PUBLISHER)
    host_partners(bench, m)
    plant = host_plant(bench, m)
    bench.until(lambda: plant.count_publishers("voltages") == 2, "the plant sees the other")
    assert not plant.done
    bench.node.destroy_publisher(leaving)
    bench.until(lambda: plant.done, "the flight has ended")
    assert plant.failed == ""


class Held:
    """A flight of plant and estimator in which this test is the controller."""

    def __init__(self, bench: Bench, mission, *overrides: str) -> None:
        self.bench = bench
        self.mission = mission(PAIR, *overrides)
        self.estimates = bench.listen("estimator/sun_estimate", SunEstimate)
        self.publisher = bench.node.create_publisher(WheelTorqueCommand, "command", LOOP_PUBLISHER)
        self.estimator = bench.host(self.mission.node("estimator").component, self.mission, "estimator")
        self.plant = host_plant(bench, self.mission)
        bench.until(lambda: len(self.estimates) == 1, "the first step")

    @property
    def step(self) -> int:
        """Step that the plant is in."""
        return (self.plant.stamp_ns - T0) // STEP

    def answer(self, step: int, torque: float = 0.0) -> None:
        """Commands."""
        self.publisher.publish(codec_of(WheelTorqueCommand).encode(command(step, torque)))

    def _passed(self, step: int) -> bool:
        return self.step > step

    def fly_to(self, step: int) -> None:
        """Answers every step before one."""
        while self.step < step:
            now = self.step
            self.answer(now, torque=float(now))
            self.bench.until(partial(self._passed, now), f"step {now} is answered")


def test_time_holds_for_a_silent_partner_and_names_it(bench, mission):
    held = Held(bench, mission, "lockstep.warn_after=0.05")
    held.fly_to(3)
    bench.until(lambda: bench.logged("simulated time holds at 0.3 s: waiting for command"), "the plant names it")
    assert held.step == 3
    held.fly_to(6)
    assert commands(held.plant) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert held.plant.counters["partners_lost"] == 0


def test_each_hold_is_named_again(bench, mission):
    held = Held(bench, mission, "lockstep.warn_after=0.05")
    held.fly_to(2)
    bench.until(lambda: bench.logged("holds at 0.2 s"), "the first hold is named")
    held.fly_to(4)
    bench.until(lambda: bench.logged("holds at 0.4 s"), "the second hold is named")
    assert bench.logged("holds at 0.2 s") == 1
    assert held.plant.counters["time_held"] == 2


def test_answers_for_other_stamps_do_not_count(bench, mission):
    held = Held(bench, mission)
    held.fly_to(3)
    held.answer(2)
    held.answer(5)
    bench.until(lambda: held.plant.counters["answers_for_another_stamp"] >= 1, "they have arrived")
    assert held.step == 3


@pytest.mark.parametrize("damage", ["malformed", "nan", "frame"])
def test_damaged_commands_never_reach_the_plant(bench, mission, damage):
    held = Held(bench, mission)
    codec = codec_of(WheelTorqueCommand)
    data = {
        "malformed": codec.encode(command(0))[:-8],
        "nan": codec.encode(command(0, torque=float("nan"))),
        "frame": codec.encode(codec.sample(T0, "imu", torque=np.zeros(1))),
    }[damage]
    held.publisher.publish(data)
    bench.until(lambda: held.plant.edges["command"].rejected.total() == 1, "it has arrived")
    assert held.step == 0
    held.fly_to(2)
    assert commands(held.plant) == [0.0, 1.0]


def test_far_future_stamp_locks_nobody_out(bench, mission):
    held = Held(bench, mission)
    held.fly_to(2)
    held.answer(10**6)
    held.answer(20)
    bench.until(lambda: held.plant.counters["answers_for_another_stamp"] == 1, "they have arrived")
    assert held.plant.edges["command"].rejected == {"stamp_jump": 1}


def test_after_the_limit_the_flight_goes_on_without_the_partner(bench, mission):
    held = Held(bench, mission, "mission.duration=2", *SHORT)
    held.fly_to(3)
    bench.until(lambda: held.plant.done, "the flight has ended")
    assert held.plant.failed == ""
    assert commands(held.plant) == [0.0, 1.0, 2.0] + [None] * 17
    assert held.plant.counters["partners_lost"] == 1
    bench.until(lambda: bench.logged("going on without, actuators at rest until it is back"), "it says so")
    # the estimator still sees every step that fits its queue
    assert held.estimator.counters["cycles"] > 3


def test_lost_partner_that_returns_is_waited_for_again(bench, mission):
    held = Held(bench, mission, "mission.duration=1000", "lockstep.warn_after=0.05", "lockstep.hold_limit=0.1")
    held.fly_to(3)
    bench.until(lambda: held.step >= 10, "the flight goes on without")
    # whatever step it answers, it is alive: time holds for it from now on
    held.answer(held.step)
    bench.until(lambda: bench.logged("command is back"), "the plant takes it back")
    stood = held.step
    held.answer(stood, torque=17.0)
    bench.until(lambda: held.step > stood, "it is listened to")
    assert commands(held.plant)[stood] == 17.0
    held.fly_to(stood + 3)
    assert commands(held.plant)[-2:] == [stood + 1.0, stood + 2.0]
    assert None not in commands(held.plant)[stood:]


def test_awaited_topic_that_the_plant_does_not_consume_is_lost_and_found_too(bench, mission):
    m = mission(
        "graph.nodes=testbed/source,testbed/estimator", "mission.duration=1000", "lockstep.warn_after=0.05",
        "lockstep.hold_limit=0.1", "estimator.use_gyro=false",
    )  # fmt: skip
    assert m.awaited == ("estimator/sun_estimate",)
    answers = bench.node.create_publisher(SunEstimate, "estimator/sun_estimate", LOOP_PUBLISHER)
    bench.listen("voltages", CssVoltages)
    bench.listen("truth", m.topics["truth"])
    plant = host_plant(bench, m)
    bench.until(lambda: plant.counters["cycles"] >= 20, "the flight goes on without")
    codec = codec_of(SunEstimate)
    answers.publish(b"\x00\x01\x00\x00")
    answers.publish(codec.encode(codec.sample(plant.stamp_ns, "bus")))
    bench.until(lambda: bench.logged("estimator/sun_estimate is back"), "the plant takes it back")
    cycles = plant.counters["cycles"]
    answers.publish(codec.encode(codec.sample(plant.stamp_ns, "bus")))
    bench.until(lambda: plant.counters["cycles"] == cycles + 1, "it is waited for, step by step")
    assert (plant.counters["partners_lost"], plant.counters["malformed_answers"]) == (1, 1)


def test_restarted_estimator_answers_the_stamp_that_waits(bench, mission):
    m = mission(PAIR, "mission.duration=8", "estimator.use_gyro=false")
    partners = host_partners(bench, m)
    plant = host_plant(bench, m)
    bench.until(lambda: plant.counters["cycles"] >= 40, "some steps are flown")
    bench.remove(partners["estimator"])
    waiting = plant.stamp_ns
    bench.host(m.node("estimator").component, m, "estimator")
    bench.until(lambda: plant.stamp_ns > waiting or plant.done, "it has answered the stamp that waited for it")
    bench.until(lambda: plant.done, "the flight has ended")
    assert plant.failed == ""
    assert plant.counters["partners_lost"] == 0
    assert commands(plant) == [float(k) for k in range(80)]
    assert partners["controller"].health()[2]["time_set_back"] == 0


def test_restarted_controller_answers_the_stamp_that_waits(bench, mission):
    m = mission(PAIR, "mission.duration=8", "estimator.use_gyro=false")
    partners = host_partners(bench, m)
    plant = host_plant(bench, m)
    bench.until(lambda: plant.counters["cycles"] >= 40, "some steps are flown")
    bench.remove(partners["controller"])
    bench.host(m.node("controller").component, m, "controller")
    bench.until(lambda: plant.done, "the flight has ended")
    assert commands(plant) == [float(k) for k in range(80)]
    assert plant.counters["partners_lost"] == 0


def test_plant_that_fails_ends_the_flight_with_its_reason(bench, mission):
    m = mission(PAIR, "source.fails_at=4")
    host_partners(bench, m)
    plant = host_plant(bench, m)
    bench.until(lambda: plant.done, "the flight has ended")
    assert plant.failed == f"the plant failed at stamp {T0 + 4 * STEP}: the plant is out of order"
    bench.until(lambda: bench.logged("RuntimeError: the plant is out of order"), "the traceback is logged")


@pytest.mark.parametrize("fault", ["begin", "message"])
def test_plant_that_cannot_begin_ends_the_flight_with_its_reason(bench, mission, monkeypatch, fault):
    m = mission("graph.nodes=testbed/source")
    component = m.plant.component
    plant = bench.host(component, m, "source", start=False)
    if fault == "begin":
        monkeypatch.setattr(component, "begin", lambda self: 1 / 0)
    else:
        monkeypatch.setattr(component, "begin", lambda self: {"unheard_of": None})
    assert plant.start()
    bench.until(lambda: plant.done, "the flight has ended")
    assert plant.failed.startswith(f"the plant failed at stamp {T0 if fault == 'message' else 0}: ")


def test_paused_plant_goes_on_where_it_stood(bench, mission):
    held = Held(bench, mission)
    held.fly_to(3)
    held.plant.trigger_deactivate()
    held.answer(3, torque=3.0)
    bench.until(lambda: held.plant.edges["command"].accepted == 4, "the answer has arrived")
    assert held.step == 3
    held.plant.trigger_activate()
    bench.until(lambda: held.step == 4, "it goes on")
    held.fly_to(6)
    assert commands(held.plant) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_plant_that_is_deactivated_before_it_began_begins_later(bench, mission):
    m = mission(PAIR, *SHORT)
    plant = host_plant(bench, m)
    plant.trigger_deactivate()
    host_partners(bench, m)
    bench.until(lambda: plant.count_publishers("command") == 1, "all partners are there")
    assert not plant.begun
    plant.trigger_activate()
    bench.until(lambda: plant.done, "the flight has ended")
    assert commands(plant) == [float(k) for k in range(10)]


def test_in_real_time_steps_keep_their_pace(bench, mission):
    # 50 steps of 10 ms of wall time each: never sooner; how much later is the machine's affair
    m = mission(PAIR, "mission.duration=5", "lockstep.realtime_factor=10")
    host_partners(bench, m)
    plant = host_plant(bench, m)
    bench.until(lambda: plant.begun, "the flight begins")
    bench.until(lambda: plant.done, "the flight has ended")
    assert plant.summary()["wall_s"] >= 0.99 * 0.01 * 48
    assert commands(plant) == [float(k) for k in range(50)]


def test_in_real_time_the_first_answer_is_never_late(bench, mission):
    # partners that are still starting take their time; a period here is a thousandth of a second
    held = Held(bench, mission, "lockstep.realtime_factor=100")
    fired = []
    timer = bench.node.create_timer(0.001, lambda: fired.append(1))
    bench.until(lambda: len(fired) >= 20, "twenty periods pass")
    bench.node.destroy_timer(timer)
    assert held.plant.counters["deadline_missed"] == 0
    held.fly_to(2)


def test_in_real_time_late_answers_are_counted(bench, mission):
    held = Held(bench, mission, "lockstep.realtime_factor=100")
    held.fly_to(2)
    missed = held.plant.counters["deadline_missed"]
    bench.until(lambda: held.plant.counters["deadline_missed"] >= missed + 5, "five periods pass")
    assert held.step == 2
    held.fly_to(4)
    assert commands(held.plant) == [0.0, 1.0, 2.0, 3.0]


def test_in_real_time_a_pause_misses_no_deadline(bench, mission):
    held = Held(bench, mission, "lockstep.realtime_factor=100")
    held.fly_to(2)
    held.plant.trigger_deactivate()
    missed = held.plant.counters["deadline_missed"]
    held.estimates.clear()
    held.answer(2)
    bench.until(lambda: held.plant.edges["command"].accepted == 3, "the answer has arrived")
    assert held.plant.counters["deadline_missed"] == missed
    assert held.step == 2
    held.plant.trigger_activate()
    held.fly_to(4)


def test_events_of_the_whole_graph_go_by_simulated_time(bench, mission, mission_text):
    text = mission_text + "    events: {off: {time: 0.5, node: gyro, action: deactivate}}\n"
    nodes = fly(bench, mission(text=text))
    covariances = [got["gyro"].angular_velocity_covariance[0] for _, got in nodes["estimator"].component.cycles]
    assert covariances == [0.0] * 5 + [-1.0] * 5


def test_summary_of_a_flight(bench, mission):
    plant = fly(bench, mission())["source"]
    summary = plant.summary()
    assert summary["last_stamp_ns"] == T0 + 9 * STEP
    assert summary["counters"]["cycles"] == 10
    assert summary["wall_s"] > 0.0
    assert summary["cpu_s"] > 0.0
