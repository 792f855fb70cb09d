# SPDX-License-Identifier: Apache-2.0
"""The spinning payload on the real graph: pulses as events, a marker for each step, lockstep, recording and replay."""

import numpy as np
import pytest
from flights import fly_composed, messages_by_topic, samples
from presence import present

from css_analysis.estimate_errors import attitude_errors
from css_analysis.flight_log import read_flight
from css_analysis.spin_flight import read_spinning
from css_analysis.spin_summary import spin_lines, spin_object
from css_bringup.replay_bag import replay
from css_bringup.replay_pass import parse_request
from css_common.component import Plant
from css_common.mission import load_mission, mission_from_text
from css_common.mission_file import MissionError
from css_monte_carlo.direct_flight import fly_and_keep
from css_msgs.msg import AttitudeEstimate, SlitPulse, SlitPulses, SlitSunAngle

SENSORS_ALONE = """
/**:
  ros__parameters:
    mission: {epoch: "2006-07-01T06:39:00Z", duration: 0.5, period: 0.01}
    orbit:
      source: ballistic
      launch: {latitude_deg: 69.29, longitude_deg: 16.02, azimuth_deg: 330.0, elevation_deg: 80.0, apogee: 169.0e+3}
    payload:
      axis_azimuth_deg: 330.0
      axis_elevation_deg: 80.0
      spin_hz: [5.45]
      coning_period: [0.2618]
      coning_angle_deg: [12.89]
    graph: {nodes: [css_sim/rocket, css_sim/slit_sensor, css_sim/magnetometer]}
"""


def esprit(duration, *overrides):
    return load_mission("esprit_2006", [f"mission.duration={duration}", *overrides])


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Eight seconds, four of them a leg for the coning; faults are frequent, so that there are some."""
    mission = esprit(8.0, "coning.legs=1,7", "slit_sensor.missed=0.02", "slit_sensor.double=0.02")
    bag = tmp_path_factory.mktemp("esprit") / "bag"
    return mission, bag, fly_composed(mission, bag)


def test_every_stamp_is_answered_by_every_node(flown):
    mission, bag, result = flown
    assert result.failure == ""
    assert result.messages_lost == 0
    expected = [mission.epoch_ns + k * mission.period_ns for k in range(800)]
    recorded = messages_by_topic(bag)
    for topic, output in mission.outputs.items():
        if not output.events:
            assert [stamp for stamp, _ in recorded[f"/{topic}"]] == expected, topic


def test_pulses_one_by_one_are_those_of_the_steps(flown):
    mission, bag, _ = flown
    steps, pulses = samples(bag, "/slits/step", SlitPulses), samples(bag, "/slits/pulse", SlitPulse)
    listed = [
        (c, s, h)
        for step in steps
        for c, s, h in zip(step.count.tolist(), step.slit.tolist(), step.head.tolist(), strict=True)
    ]
    assert sorted(listed) == sorted((p.count, p.slit, p.head) for p in pulses)
    assert len(pulses) > 120
    assert max(len(step.count) for step in steps) >= 2
    for pulse in pulses:
        assert pulse.stamp_ns == mission.epoch_ns + pulse.count * 1000  # microseconds of the timer
    for step in steps:
        assert step.timer == (step.stamp_ns - mission.epoch_ns) // 1000


def test_the_estimators_replay_to_the_bytes_that_flew(flown, tmp_path):
    mission, bag, _ = flown
    requests = [parse_request(name) for name in ("slit_sun_angle", "triad", "coning")]
    result = replay(bag, tmp_path / "replayed", mission, requests, {})
    assert [present(run.comparison).identical for run in result.replayed] == [True, True, True]


def test_calls_one_after_the_other_give_what_topics_give(flown):
    mission, bag, _ = flown
    kept = fly_and_keep(mission, ["slit_sun_angle/sun_angle", "triad/attitude"])
    for topic, kind in (("slit_sun_angle/sun_angle", SlitSunAngle), ("triad/attitude", AttitudeEstimate)):
        for direct, recorded in zip(kept[topic], samples(bag, f"/{topic}", kind), strict=True):
            assert direct.stamp_ns == recorded.stamp_ns
            for name in kind.get_fields_and_field_types():
                if name != "header":
                    np.testing.assert_array_equal(getattr(direct, name), getattr(recorded, name))


def test_a_recording_tells_spin_and_coning(flown):
    _, bag, _ = flown
    flight = read_spinning(bag)
    assert 35 < len(present(flight).passages.time) < 48
    assert present(flight).refused > 0
    assert present(flight).reasons.total() == present(flight).refused
    told = spin_object(present(flight))
    assert told["legs"][0]["spin_hz"] == pytest.approx(6.0, rel=0.005)
    assert told["attitudes"] == len(present(flight).attitudes) > 30
    assert len(spin_lines(present(flight))) == 2


def test_attitudes_of_a_recording_are_measured_at_their_own_instants(flown):
    """At 6 Hz an attitude compared with the truth of its stamp would be off by a turn of up to 180 deg."""
    _, bag, _ = flown
    _, errors, nees = attitude_errors(read_flight(bag), "triad")
    assert len(errors) > 700
    assert np.degrees(errors.max()) < 2.0
    assert np.mean(nees) < 4.0


def test_sensors_alone_are_awaited_by_their_marker(tmp_path):
    mission = mission_from_text(SENSORS_ALONE, "sensors alone")
    assert set(mission.awaited) == {"slits/step", "mag/field"}
    assert fly_composed(mission, tmp_path / "bag").messages_lost == 0
    assert len(samples(tmp_path / "bag", "/slits/pulse", SlitPulse)) >= 6


def test_nothing_can_wait_for_an_event():
    with pytest.raises(MissionError, match="only when something happens"):
        esprit(1.0, "lockstep.wait_for=slits/pulse")


def test_a_truth_of_another_motion_gives_no_pulses():
    mission = mission_from_text(SENSORS_ALONE, "sensors alone")
    rocket = mission.node("rocket")
    other = mission.with_overrides(["payload.axis_elevation_deg=60"]).node("slit_sensor")
    plant = rocket.component(rocket.name, rocket.values)
    assert isinstance(plant, Plant)
    truth = plant.begin()["truth"]
    sensor = other.component(other.name, other.values)
    with pytest.raises(ValueError, match="not the motion of the payload section"):
        sensor.cycle(mission.epoch_ns, {"truth": truth})
