# SPDX-License-Identifier: Apache-2.0
"""A flight that is held, stepped and made slower or faster in flight: by services and a parameter."""

import math

import pytest
from presence import present
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import Trigger

from css_common.mission import Mission
from css_common.plant_host import PlantNode
from css_common.plant_pace import PlantPace
from css_common.testing import Bench
from css_msgs.msg import CssVoltages, SunEstimate


class Flight:
    """A small flight without its end in sight, and services of its plant."""

    def __init__(self, bench: Bench, mission: Mission, *, paused: bool = False) -> None:
        self.bench = bench
        self.voltages = bench.listen("voltages", CssVoltages)
        self.estimates = bench.listen("estimator/sun_estimate", SunEstimate)
        for partner in mission.nodes:
            if partner is not mission.plant:
                bench.host(partner.component, mission, partner.name)
        plant = present(mission.plant)
        node = bench.host(plant.component, mission, plant.name, start=False)
        assert isinstance(node, PlantNode)
        self.plant: PlantNode = node
        if paused:
            node.pace.pause()
        assert node.start()

    @property
    def step(self) -> int:
        return self.plant.counters["cycles"]

    def ask(self, name: str) -> tuple[bool, str]:
        answer = self.bench.request(Trigger, f"/source/{name}", Trigger.Request())
        return answer.success, answer.message

    def set_rate(self, rate: float) -> tuple[bool, str]:
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=rate)
        request = SetParameters.Request(parameters=[Parameter(name="rate", value=value)])
        (result,) = self.bench.request(SetParameters, "/source/set_parameters", request).results
        return result.successful, result.reason

    def fly_to(self, step: int) -> None:
        self.bench.until(lambda: self.step >= step, f"step {step}")

    def settle(self) -> int:
        """The step at which a flight that is held stands, once all have answered it."""
        self.bench.until(lambda: self.plant.answered, "everybody has answered")
        before = self.step
        # twenty rounds of a service later nothing has moved
        for _ in range(20):
            assert self.ask("is_paused") == (True, "paused: True")
        assert self.step == before
        return before


LONG = "mission.duration=1000000"


def test_held_at_once_and_let_go(bench, mission):
    flight = Flight(bench, mission(LONG))
    flight.fly_to(20)
    assert flight.ask("pause") == (True, "paused")
    at = flight.settle()
    assert flight.ask("resume") == (True, "playing")
    flight.fly_to(at + 20)
    assert flight.plant.counters["deadline_missed"] == 0
    assert flight.ask("toggle_paused") == (True, "paused")
    flight.settle()
    # what was held is what would have come: no stamp twice, none left out
    bench.until(lambda: len(flight.voltages) >= flight.step, "all is heard")
    stamps = [sample.stamp_ns for sample in flight.voltages]
    assert stamps == [stamps[0] + k * 100_000_000 for k in range(len(stamps))]


def test_held_from_the_start_and_stepped(bench, mission):
    flight = Flight(bench, mission(LONG), paused=True)
    flight.fly_to(1)
    assert flight.settle() == 1
    for step in (2, 3, 4):
        assert flight.ask("play_next_stamp") == (True, "one stamp")
        flight.fly_to(step)
        assert flight.settle() == step
    assert flight.ask("resume")[0]
    flight.fly_to(40)
    assert flight.ask("play_next_stamp") == (False, "not paused: pause first")


def test_steps_that_are_granted_before_the_last_is_answered_are_not_lost(bench, mission):
    flight = Flight(bench, mission(LONG), paused=True)
    flight.fly_to(1)
    at = flight.settle()
    for _ in range(5):
        flight.plant.pace.grant_stamp()
    flight.fly_to(at + 5)
    assert flight.settle() == at + 5


def test_the_rate_is_a_parameter_in_flight(bench, mission):
    flight = Flight(bench, mission(LONG))
    flight.fly_to(5)
    assert flight.plant.get_parameter("rate").value == math.inf
    for wrong in (0.0, -1.0, math.nan):
        assert flight.set_rate(wrong) == (False, f"rate: {wrong} given, expected a number above 0")
    # a step in some hours: it stands, and says that it is not held
    assert flight.set_rate(1e-5)[0]
    bench.until(lambda: flight.plant.answered, "everybody has answered")
    at = flight.step
    for _ in range(20):
        assert flight.ask("is_paused") == (True, "paused: False")
    assert flight.step == at
    assert flight.set_rate(math.inf)[0]
    flight.fly_to(at + 50)


def test_pace_of_a_flight_in_real_time_is_that_of_its_mission_until_it_is_changed(bench, mission):
    flight = Flight(bench, mission(LONG, "lockstep.realtime_factor=0.00001"))
    flight.fly_to(1)
    assert flight.plant.get_parameter("rate").value == 1e-5
    bench.until(lambda: flight.plant.answered, "everybody has answered")
    assert flight.step == 1
    assert flight.set_rate(1000.0)[0]
    flight.fly_to(30)


def test_a_pause_outlives_deactivation(bench, mission):
    flight = Flight(bench, mission(LONG))
    flight.fly_to(5)
    flight.ask("pause")
    at = flight.settle()
    flight.plant.trigger_deactivate()
    assert flight.ask("resume") == (True, "playing")
    for _ in range(20):
        assert flight.ask("is_paused") == (True, "paused: False")
    assert flight.step == at  # inactive it does not go on
    flight.plant.trigger_activate()
    flight.fly_to(at + 10)


def test_health_says_that_it_is_held(bench, mission):
    flight = Flight(bench, mission("mission.duration=5"), paused=True)
    flight.fly_to(1)
    assert flight.plant.health().message == "paused"
    flight.plant.pace.resume()
    assert flight.plant.health().message == "active"
    bench.until(lambda: flight.plant.done, "the flight has ended")
    assert flight.plant.health().message == "the flight has ended"


def test_a_held_partner_is_no_silent_one(bench, mission):
    flight = Flight(bench, mission(LONG, "lockstep.warn_after=0.05", "lockstep.hold_limit=0.2"))
    flight.fly_to(5)
    flight.ask("pause")
    at = flight.settle()
    fired: list[int] = []
    timer = bench.node.create_timer(0.05, lambda: fired.append(1))
    bench.until(lambda: len(fired) >= 10, "longer than the limit of silence passes")
    bench.node.destroy_timer(timer)
    assert flight.step == at
    assert flight.plant.counters["time_held"] == flight.plant.counters["partners_lost"] == 0


def test_a_rate_from_the_command_line_of_ros_is_checked(mission, monkeypatch):
    with Bench() as bench:
        m = mission()
        plant = present(m.plant)
        node = PlantNode(plant.component, plant.name, m, context=bench.context, use_global_arguments=False)
        bench.add(node)
        (result,) = node.set_parameters([RosParameter("rate", value="fast")])
        assert not result.successful


@pytest.mark.parametrize("rate", [0.5, math.inf])
def test_what_is_free(rate):
    changes: list[int] = []
    pace = PlantPace(rate, lambda: changes.append(1))
    assert pace.free == (rate == math.inf)
    pace.pause()
    assert not pace.free and not pace.take_granted()
    pace.grant_stamp()
    assert pace.take_granted() and not pace.take_granted()
    pace.grant_stamp()
    pace.pause()
    assert not pace.take_granted()  # a pause takes back what was granted before
    pace.resume()
    assert pace.free == (rate == math.inf)
    assert len(changes) == 5
