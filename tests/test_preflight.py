# SPDX-License-Identifier: Apache-2.0
"""What physics and numerics forbid is refused before a flight however it is flown, what is doubtful is named."""

import json
import math
import re

import numpy as np
import pytest
from flights import short_mission
from listing import MISSIONS
from presence import present

from css_analysis.errors import StudyError
from css_bringup.commands import fly
from css_common.command import USAGE
from css_common.mission import load_mission, mission_from_text
from css_common.mission_file import MissionError
from css_common.node_process import run_node
from css_common.preflight import preflight
from css_monte_carlo.commands import monte_carlo
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.study import Configuration, run_study
from css_papers.okeefe.configurations import AS_PRINTED, IMPROVED
from css_sim.flight_checks import FASTEST, MotionError, check_rate
from css_sim.nodes.dynamics import Dynamics

UNSTABLE = "mrp_control.gains.p=5000"


@pytest.mark.parametrize("name", MISSIONS)
def test_our_missions_pass_without_a_word(name):
    assert preflight(load_mission(name)) == []


@pytest.mark.parametrize("entry", [*AS_PRINTED, *IMPROVED], ids=lambda entry: entry.label)
def test_the_configurations_of_the_paper_pass(entry):
    assert preflight(entry.configuration.applied(load_mission("okeefe_2013"))) == []


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ([UNSTABLE], "mrp_control: gains.p: 5000 given, expected at most 4.29e+03 with k 0.148"),
        (["mission.period=60"], "mrp_control: gains.p: 0.9 given, expected at most 0.225"),
        (["mrp_control.gains.p=0"], "mrp_control: gains.p: 0 given, expected at least 0.00171"),
        (["ekf.use_gyro=false", "mrp_control.gains.k=20"], "mrp_control: gains.k: 20 given, expected at most"),
        (["dynamics.initial.max_rate_deg_s=3600", "dynamics.initial.rate=fixed",
          "dynamics.initial.omega_deg_s=20000,0,0"], "dynamics: initial.omega_deg_s: up to 20000 deg/s given"),
        (["orbit.source=tle", "orbit.tle_line1=" + 69 * "1", "orbit.tle_line2=" + 69 * "2"], "/**: orbit.tle_line1: "),
        (["rods.fitted=true", "mission.epoch=2036-06-01T00:00:00Z"], "/**: mission.epoch: the flight ends in 2036"),
        (["wheels.max_torque=1e6"],
         "/**: wheels.max_torque: up to 2.83e+06 N m given, which in a cycle of 0.1 s makes"),
        (["dynamics.disturbances.torque=0,0,1e6"], "dynamics: disturbances.torque: up to 1e+06 N m given"),
        (["mission.period=0.25", "rods.fitted=true", "mrp_control.dumping.enabled=true",
          "mrp_control.dumping.gain=10"], "mrp_control: dumping.gain: 10 given, 2.5 of a wheel's momentum in a cycle"),
    ],
)  # fmt: skip
def test_refused(overrides, words):
    with pytest.raises(MissionError, match=r"okeefe_2013\.yaml: " + re.escape(words)):
        preflight(short_mission(60.0, *overrides))


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["mrp_control.gains.p=3000"], "mrp_control: gains.p: 3000 given, expected a gain margin of at least 6 dB"),
        (["mrp_control.wheels_out=0,1"], "mrp_control: wheels_out: the wheels that are left turn the body about 2"),
        (["mission.period=1.0", "dynamics.initial.max_rate_deg_s=40"], "/**: mission.period: 1 given, in which"),
        (["dynamics.initial.wheel_speed_rpm=6000"], "dynamics: initial.wheel_speed_rpm: 6000 given, expected"),
        (["wheels.max_speed_rpm=1000"], "/**: wheels.max_speed_rpm: 1000 given, expected at least 34"),
        (["css_array.noise=0.5"], "css_array: noise: 0.5 given, expected at most 0.3: the measurement drowns"),
        (["gyro.noise_deg_s=10"], "gyro: noise_deg_s: 10 given"),
        (["orbit.altitude=4e8"], "/**: orbit.altitude: 4e+08 given"),
        (["rods.fitted=true", "mission.epoch=2031-06-01T00:00:00Z"], "/**: mission.epoch: the flight ends in 2031"),
        (["dynamics.disturbances.dipole=50,0,0", "mission.duration=86400"], "/**: mission.period: 0.1 given, over"),
        (["wheels.max_torque=1000"], "/**: wheels.max_torque: up to 2.83e+03 N m given"),
        (["mission.period=0.25", "rods.fitted=true", "mrp_control.dumping.enabled=true",
          "mrp_control.dumping.gain=5"], "mrp_control: dumping.gain: 5 given, 1.25 of a wheel's momentum in a cycle"),
        (["mission.period=1.0", "mrp_control.reference.spin_deg_s=60"], "mrp_control: reference.spin_deg_s: 60 given"),
    ],
)  # fmt: skip
def test_warned(overrides, words):
    warnings = preflight(short_mission(60.0, *overrides))
    assert any(line.partition("okeefe_2013.yaml: ")[2].startswith(words) for line in warnings), warnings


@pytest.mark.parametrize(("gain", "refused"), [(0.015, False), (0.021, True)])
def test_rods_that_take_more_than_twice_the_rate_are_refused(gain, refused):
    """The moment about the spin axis' neighbour is 0.01 kg m^2, and a command is held for a second."""
    mission = load_mission("cubesat_3u_safe", [f"magnetic_control.gains.damping={gain}"])
    if refused:
        with pytest.raises(MissionError, match=r"takes 2\.1 of the body rate at a time, .*: from 2 on the rate grows"):
            preflight(mission)
    else:
        assert any("takes 1.5 of the body rate" in line for line in preflight(mission))


def with_event(parameter, value):
    event = f"{{time: 30.0, node: mrp_control, action: set, parameter: {parameter}, value: {value}}}"
    return mission_from_text(
        f"/**:\n  ros__parameters:\n    extends: okeefe_2013\n    events:\n      late: {event}\n", "scripted.yaml"
    )


def test_scripted_changes_are_checked_where_they_happen():
    with pytest.raises(MissionError, match=r"gains\.p: 5000\.?0? given.* \(from 30 s on, by the event late\)"):
        preflight(with_event("gains.p", "5000.0"))
    (warning,) = preflight(with_event("gains.p", "3000.0"))
    assert warning.endswith("(from 30 s on, by the event late)")
    assert preflight(with_event("gains.p", "1.0")) == []


def test_a_refused_mission_is_still_read_for_its_recordings():
    assert load_mission("okeefe_2013", [UNSTABLE]).node("mrp_control").values.gains.p == 5000.0


def test_every_way_to_fly_refuses(tmp_path, capfd):
    mission = short_mission(1.0, UNSTABLE)
    path = tmp_path / "bad.yaml"
    path.write_text(mission.text())
    assert fly.main([str(path), "--out", str(tmp_path / "bag")]) == USAGE
    assert run_node(Dynamics, ["--ros-args", "--params-file", str(path)]) == USAGE
    assert monte_carlo.main([str(path), "--cases", "1", "--out", str(tmp_path / "study")]) == USAGE
    said = " ".join(capfd.readouterr().err.split())
    assert said.count("gains.p: 5000 given, expected at most 4.29e+03") == 3
    with pytest.raises(MissionError, match=r"gains\.p: 5000"):
        fly_directly(mission)
    assert not (tmp_path / "bag").exists() and not (tmp_path / "study").exists()


def test_warnings_stand_before_the_flight_and_in_its_json(tmp_path, capfd):
    options = ["--set", "css_array.noise=0.6", "--duration", "1", "--json"]
    fly.main(["okeefe_2013", *options, "--out", str(tmp_path / "bag")])
    flown = capfd.readouterr()
    assert monte_carlo.main(["okeefe_2013", *options, "--cases", "1", "--out", str(tmp_path / "study")]) == 0
    for printed in (flown.out, capfd.readouterr().out):
        # so much noise may also have cells held for failed
        (warning,) = (w for w in json.loads(printed.splitlines()[-1])["warnings"] if "held" not in w)
        assert "noise: 0.6 given" in warning
    assert flown.err.count("noise: 0.6 given") == 1


def test_a_body_beyond_all_reason_ends_the_flight():
    check_rate((FASTEST, 0.0, 0.0))
    for omega in ((FASTEST, 1.0, 0.0), (math.nan, 0.0, 0.0), (0.0, -math.inf, 0.0)):
        with pytest.raises(MotionError, match="deg/s, expected at most 11459: look at"):
            check_rate(omega)


def test_a_rate_that_builds_up_ends_the_flight_by_name(tmp_path):
    # a magnet in orbit that is all dipole and no mass
    inertia = "spacecraft.inertia=1e-9,0,0,0,1e-9,0,0,0,1e-9"
    mission = short_mission(60.0, inertia, "dynamics.disturbances.dipole=99,0,0", "wheels.max_torque=1e-12",
                            "mrp_control.gains.k=0", "mrp_control.gains.p=0")  # fmt: skip
    with pytest.raises(MotionError, match="the body turns at"):
        fly_directly(mission)
    with pytest.raises(StudyError, match="case 0 of okeefe_2013, after 0 s: the body turns at"):
        run_study(mission, [Configuration("ekf", True)], 1, tmp_path / "study")


PURE = (
    "mrp_control.deadband_deg=0", "mrp_control.modes.detumble_rate_deg_s=360", "dynamics.initial.rate=fixed",
    "dynamics.initial.omega_deg_s=0.01,-0.02,0.015", "css_array.albedo.enabled=false", "css_array.warp=false",
    "css_array.degradation=0", "gyro.noise_deg_s=0", "gyro.bias_deg_h=0",
)  # fmt: skip


@pytest.mark.parametrize("cutoff", ["0.1", "1000"])
def test_gains_fly_below_the_limit_and_swing_between_torque_limits_above(cutoff, monkeypatch):
    monkeypatch.setattr("css_monte_carlo.direct_flight.preflight", lambda mission: [])
    mission = short_mission(60.0, *PURE, f"ekf.rate.cutoff={cutoff}")
    with pytest.raises(MissionError) as refusal:
        preflight(mission.with_overrides(["mrp_control.gains.p=5000"]))
    limit = float(str(refusal.value).split("expected at most ")[1].split()[0])

    def wheels(share):
        flown = mission.with_overrides([f"mrp_control.gains.p={share * limit}"])
        torque = present(fly_directly(flown).wheels).torque[-100:]
        return np.max(np.abs(torque)), np.mean(np.sign(torque[1:, 0]) != np.sign(torque[:-1, 0]))

    calm, _ = wheels(0.9)
    wild, turns = wheels(1.1)
    assert calm < 0.5 * mission.values.wheels.max_torque
    assert wild == pytest.approx(mission.values.wheels.max_torque) and turns > 0.3
