# SPDX-License-Identifier: Apache-2.0
"""Replay of flights in which something changed: scripted events, parameters set and nodes switched by an operator."""

from pathlib import Path

import pytest
from flights import fly_composed, messages_by_topic, samples
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from presence import present
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from css_bringup.composed import ComposedFlight
from css_bringup.replay_bag import ReplayResult, mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_common.mission import Mission, find_mission, mission_from_text
from css_msgs.msg import SunEstimate

# the control listens to another estimator, and nobody waits for the one that is switched off
BESIDE = (
    "graph.nodes=css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_estimation/ekf,css_estimation/wavg,"
    "sunpoint_control/mrp_control",
    "graph.estimator=wavg",
    "lockstep.wait_for=wheels/torque_command",
)


def scripted(*events: str, duration: float = 30.0, overrides: tuple[str, ...] = ()) -> Mission:
    text = find_mission("okeefe_2013").read_text()
    script = "".join(f"      e{number}: {{{event}}}\n" for number, event in enumerate(events))
    if script:
        text = text.replace("    criteria:", f"    events:\n{script}    criteria:")
    return mission_from_text(text, "scripted", [f"mission.duration={duration}", *overrides])


def replayed(bag: Path, *requests: str, overrides: tuple[str, ...] = ()) -> ReplayResult:
    mission = mission_of_bag(bag, {}, overrides, None)
    out = bag.with_name(f"{bag.name}_replay")
    return replay(bag, out, mission, map(parse_request, requests), {}, overrides=overrides, overwrite=True)


def assert_identical(result: ReplayResult, compared: int) -> None:
    run = result.replayed[0]
    assert run.comparison is not None
    assert run.comparison.text() == f"all {compared} estimates are the bytes that flew", (run.notes, result.reports)
    assert result.shortcomings == []


@pytest.fixture(scope="module")
def flight_with_a_set_value(tmp_path_factory) -> Path:
    bag = tmp_path_factory.mktemp("set") / "bag"
    mission = scripted(
        "time: 10.0, node: ekf, action: set, parameter: cell_sigma, value: 0.3",
        "time: 20.0, node: ekf, action: set, parameter: use_gyro, value: false",
    )
    assert fly_composed(mission, bag).messages_lost == 0
    return bag


def test_a_scripted_value_changes_the_replay_at_its_step(flight_with_a_set_value):
    result = replayed(flight_with_a_set_value, "ekf")
    assert_identical(result, 300)
    assert "event e0 at 10 s, set cell_sigma: as in flight" in result.replayed[0].notes
    # without the first event two thirds of the estimates would differ
    result = replayed(flight_with_a_set_value, "ekf:cell_sigma=0.1")
    bag = flight_with_a_set_value
    flown = messages_by_topic(bag)["/ekf/sun_estimate"]
    other = messages_by_topic(bag.with_name(f"{bag.name}_replay"))["/ekf_cell_sigma_0_1/sun_estimate"]
    assert [a == b for a, b in zip(flown, other, strict=True)] == [True] * 100 + [False] * 200


def test_a_value_that_is_asked_for_stays_over_events_and_that_is_said(flight_with_a_set_value):
    result = replayed(flight_with_a_set_value, "ekf:cell_sigma=0.1")
    (run,) = result.replayed
    assert run.comparison is None
    assert run.stepper.canonical["cell_sigma"] == 0.1
    assert run.stepper.canonical["use_gyro"] is False
    assert any("cell_sigma keeps the value that was asked for" in note for note in run.notes)
    result = replayed(flight_with_a_set_value, "ekf", overrides=("ekf.cell_sigma=0.1",))
    assert result.replayed[0].comparison is None
    assert result.replayed[0].stepper.canonical["cell_sigma"] == 0.1


def test_events_of_one_estimator_are_not_those_of_another(flight_with_a_set_value):
    (run,) = replayed(flight_with_a_set_value, "wls").replayed
    assert run.stepper.canonical["cell_sigma"] != 0.3
    assert run.stepper.canonical["use_gyro"] is True
    assert (run.messages, run.notes) == (300, [])


@pytest.mark.parametrize("node", ["gyro", "ekf"])
def test_a_node_that_was_off_for_a_while_by_script(tmp_path, node):
    mission = scripted(
        f"time: 10.0, node: {node}, action: deactivate",
        f"time: 12.0, node: {node}, action: activate",
        overrides=BESIDE,
    )
    fly_composed(mission, tmp_path / "bag")
    flown = len(samples(tmp_path / "bag", "/ekf/sun_estimate", SunEstimate))
    assert flown == (300 if node == "gyro" else 280)
    assert_identical(replayed(tmp_path / "bag", "ekf"), flown)


class Operator:
    """Sends requests to nodes of a flight, one after the other, each once the flight has come so far."""

    def __init__(self, flight: ComposedFlight) -> None:
        self.node = Node("operator", context=flight.context, use_global_arguments=False)
        self.flight = flight
        self.asked: list = []
        flight.executor.add_node(self.node)

    def fly(self, *requests: tuple[float, type, str, object], end: float) -> None:
        """Flies; requests are time [s], service type, name and request."""
        clients = [self.node.create_client(kind, name) for _, kind, name, _ in requests]

        def follow(seconds: float) -> None:
            done = all(future.done() for future in self.asked)
            if len(self.asked) < len(requests):
                time, _, _, request = requests[len(self.asked)]
                client = clients[len(self.asked)]
                if done and seconds >= time and client.service_is_ready():
                    self.asked.append(client.call_async(request))
            elif done and seconds >= end:
                self.flight.plant.halt()

        self.flight.fly(follow)
        assert all(future.done() for future in self.asked) and len(self.asked) == len(requests)
        self.flight.executor.remove_node(self.node)
        self.node.destroy_node()


def setting(name: str, value: object) -> SetParameters.Request:
    return SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])


def operated(bag: Path, *requests: tuple[float, type, str, object], end: float) -> None:
    mission = scripted(duration=3600.0, overrides=BESIDE)
    with ComposedFlight(mission, bag) as flight:
        Operator(flight).fly(*requests, end=end)
        assert not flight.plant.counters["time_held"], "whom an operator switches off is not waited for"


def test_the_step_at_which_an_operator_set_a_parameter_is_found(tmp_path):
    operated(
        tmp_path / "bag",
        (20.0, SetParameters, "ekf/set_parameters", setting("cell_sigma", 0.3)),
        (60.0, SetParameters, "ekf/set_parameters", setting("use_gyro", False)),
        end=100.0,
    )
    flown = len(samples(tmp_path / "bag", "/ekf/sun_estimate", SunEstimate))
    result = replayed(tmp_path / "bag", "ekf", "ekf:cell_sigma=0.1")
    assert_identical(result, flown)
    notes = " ".join(result.replayed[0].notes)
    assert "cell_sigma=0.3 was set before stamp" in notes and "use_gyro=False was set before stamp" in notes
    assert result.replayed[1].stepper.canonical["cell_sigma"] == 0.1
    assert result.replayed[1].stepper.canonical["use_gyro"] is False


def test_an_estimator_that_an_operator_switched_off_and_on_began_anew_and_that_is_named(tmp_path):
    def switch(number: int) -> ChangeState.Request:
        return ChangeState.Request(transition=Transition(id=number))

    operated(
        tmp_path / "bag",
        (20.0, ChangeState, "ekf/change_state", switch(Transition.TRANSITION_DEACTIVATE)),
        (40.0, ChangeState, "ekf/change_state", switch(Transition.TRANSITION_ACTIVATE)),
        end=60.0,
    )
    flown = len(samples(tmp_path / "bag", "/ekf/sun_estimate", SunEstimate))
    result = replayed(tmp_path / "bag", "ekf")
    assert_identical(result, flown)
    (note,) = result.replayed[0].notes
    assert "began anew in flight at stamp" in note
    assert f"after {present(result.replayed[0].comparison).excused} stamps without an estimate" in note
    assert present(result.replayed[0].comparison).excused > 0
