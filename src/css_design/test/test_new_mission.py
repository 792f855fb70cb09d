# SPDX-License-Identifier: Apache-2.0
"""Missions that `new` writes: every template passes the checks, acquires the Sun, and says what was assumed."""

import json
import math

import numpy as np
import pytest

from css_common.command import USAGE
from css_common.mission import load_mission, mission_from_text
from css_common.preflight import preflight
from css_design.commands import new
from css_design.errors import DesignError
from css_design.new_mission.commented import Entry, number_word, parameter_file
from css_design.new_mission.gains import gain_margin_db
from css_design.new_mission.new_mission import new_mission, read_items
from css_design.new_mission.questions import ask
from css_design.new_mission.templates import TEMPLATES
from css_design.verbs import new as new_verb
from css_monte_carlo.study import Configuration, run_study
from sunpoint_control.control_checks import loop_model
from sunpoint_control.loop_stability import Gains


def made(template, name="mine", **given):
    return new_mission(name, *read_items(given, template))


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_template_passes_every_check(template):
    mission = made(template)
    assert mission.warnings == ()
    again = mission_from_text(mission.text, "mine.yaml")
    assert preflight(again) == []
    assert np.allclose(again.values.spacecraft.inertia, mission.design.inertia, rtol=1e-5, atol=1e-12)
    assert again.values.orbit.inclination_deg == pytest.approx(97.40, abs=0.01)
    if mission.design.loop is not None:
        control = again.node("mrp_control")
        model = loop_model(control.values, {node.name: node for node in again.nodes})
        gains = Gains(control.values.gains.k, control.values.gains.p, control.values.gains.ki)
        assert gain_margin_db(model, gains) == pytest.approx(mission.design.loop.margin_db, abs=0.1)


@pytest.mark.parametrize("template", ["1u", "3u", "6u"])
def test_six_faces_acquire_the_sun(template, tmp_path):
    """From a tumble in any attitude: all of a few cases are on the Sun after ten minutes, and stay."""
    # in sunlight from the start: a quarter of the orbit after the node at 10:30
    mission = made(template).mission.with_overrides(["mission.duration=1200", "orbit.true_anomaly_deg=90"])
    study = run_study(mission, [Configuration("sun_filter", True)], 3, tmp_path / "study")
    acquired = np.array(study.cases["acquired_s"].to_pylist(), dtype=float)
    pointing = np.array(study.cases["pointing_error_mean_deg"].to_pylist(), dtype=float)
    assert np.all(acquired < 600.0) and np.all(pointing < 30.0), (acquired, pointing)


def test_the_estimator_is_told_what_healthy_sensors_read():
    """Of a body that its wheels turn up by 8.6 deg/s^2, with a gyro of 0.2 deg/s and cells of 10 %."""
    given = {"gyro": "0.2", "gyro_bias": "720", "cell_noise": "0.03", "cell_scale": "0.1", "magnetometer": "900"}
    mission = made("3u", wheels="3", wheel_torque="0.001", rods="none", **given).mission
    health = mission.node("sun_filter").values.health
    assert health.gyro.noise_deg_s == 0.2 and health.gyro.bias_deg_s == 0.2 and health.field.noise_nt == 900.0
    assert (health.cells.noise, health.cells.share) == (0.03, 0.1)
    moments = np.diag(np.asarray(mission.values.spacecraft.inertia))
    assert health.gyro.acceleration_deg_s2 == pytest.approx(1.5 * math.degrees(0.001 / moments.min()), rel=1e-3)
    # what a quiet and slow one reads is as usual
    assert "health" not in made("smallsat", cell_scale="0.01", wheel_torque="0.005").text


def test_a_spacecraft_without_gyro_or_wheels_gets_what_it_needs():
    rods = made("3u-rods")
    names = {node.name for node in rods.mission.nodes}
    assert "magnetic_control" in names and "gyro" not in names
    gyroless = made("3u", gyro="none")
    assert gyroless.design.estimator == "sun_filter"
    assert "gyro" not in {node.name for node in gyroless.mission.nodes}


def test_numbers_of_the_file_are_those_asked_for(tmp_path):
    path = tmp_path / "mine.yaml"
    arguments = ["mine", "--inertia", "0.05,0.04,0.02", "--cells", "+x,-x,+y,-y,+z,-z,1/0/1", "--wheels", "4",
                 "--wheel-momentum", "0.02", "--wheel-speed", "5000", "--gyro", "0.02", "--tip-off", "2",
                 "--array-normal=-z", "--orbit", "elements 600 51.6 30", "--epoch", "2027-03-01", "--cell-noise",
                 "0.02", "--out", str(path)]  # fmt: skip
    assert new.main(arguments) == 0
    mission = load_mission(str(path))
    values = mission.values
    assert np.array_equal(values.spacecraft.inertia, np.diag([0.05, 0.04, 0.02]))
    assert np.array_equal(values.spacecraft.array_normal, (0.0, 0.0, -1.0))
    assert len(values.cells.normals) == 7 and len(values.wheels.axes) == 4
    assert values.wheels.inertia * 5000 * 2 * math.pi / 60 == pytest.approx(0.02, rel=1e-5)
    assert values.orbit.altitude == 600e3 and values.orbit.raan_deg == 30.0
    assert mission.node("gyro").values.noise_deg_s == 0.02
    assert mission.node("css_array").values.noise == 0.02
    assert mission.node("dynamics").values.initial.rate_deg_s == 2.0
    text = path.read_text()
    assert "[assumed]" in text.split("bits:")[1].splitlines()[0]
    assert "[assumed]" not in text.split("max_speed_rpm:")[1].splitlines()[0]


@pytest.mark.parametrize("estimator", ["sun_filter", "ekf", "wls", "wavg"])
def test_an_estimator_expects_the_cells_and_sensors_that_were_asked_for(estimator):
    given = {"cell_noise": "0.03", "cell_bits": "6", "cell_scale": "0.05", "cell_tilt": "2", "tip_off": "3",
             "gyro": "0.02", "gyro_bias": "5", "magnetometer": "150"}  # fmt: skip
    mission = made("3u", estimator=estimator, **given).mission
    cells, values = mission.node("css_array").values, mission.node(estimator).values
    assert (cells.noise, cells.bits, cells.scale_cell_error, cells.misalignment_deg) == (0.03, 6, 0.05, 2.0)
    assert (cells.output_high, cells.warp, cells.degradation) == (2.0, False, 0.0)
    if estimator in ("ekf", "wls"):
        # mean squares over the half sphere that a cell sees: cos^2 1/3, sin^2 2/3; a step of 2 / 2^6, 0.1 of Earthlight
        squares = 0.03**2 + (2.0 / 64) ** 2 / 12.0 + 0.05**2 / 3.0 + math.radians(2.0) ** 2 * 2.0 / 3.0 + 0.1**2
        assert values.cell_sigma == pytest.approx(math.sqrt(squares), rel=5e-3)
    if estimator == "sun_filter":
        assert (values.noise, values.gain_sigma, values.tilt_sigma_deg, values.output_low) == (0.03, 0.05, 2.0, 0.0)
        assert (values.gyro.noise_deg_s, values.gyro.bias_deg_h, values.rate.start_deg_s) == (0.02, 5.0, 3.0)
        assert (values.use_field, values.field.noise_nt, values.field.error_nt) == (True, 150.0, 300.0)
    else:
        # above what noise lights (5 sigma) and the Earth
        assert values.gate == {"ekf": 0.4, "wls": 0.45, "wavg": 0.45}[estimator]
    assert (values.eclipse.dark_level, values.eclipse.lit_level, values.minimum_output) == (0.15, 0.3, 0.3)


@pytest.mark.parametrize(("altitude", "air"), [(300, (300e3, 1.9e-11, 50e3)), (560, (600e3, 1.5e-13, 71.8e3))])
def test_all_that_disturbs_the_body_is_on(altitude, air):
    values = made("3u", orbit=f"elements {altitude} 51.6 30").mission.node("dynamics").values
    assert values.disturbances.gravity_gradient and values.disturbances.solar_pressure
    assert values.disturbances.aerodynamic
    assert (values.air.altitude, values.air.density, values.air.scale_height) == air


def test_no_air_is_left_where_none_is_known():
    assert not made("3u", orbit="elements 1200 51.6 30").mission.node("dynamics").values.disturbances.aerodynamic


WRONG = [
    (["--mass", "-1"], "--mass: '-1' given, expected a number from"),
    (["--mass", "nan"], "--mass: 'nan' given"),
    (["--size", "1,1"], "--size: '1,1' given, expected 3 numbers"),
    (["--wheels", "5"], "--wheels: '5' given, expected one of 3, 4, none"),
    (["--wheels", "none", "--rods", "none"], "nothing turns the body"),
    (["--wheels", "none", "--magnetometer", "none"], "steered by the measured field"),
    (["--inertia", "1,1,5"], "no rigid body has these"),
    (["--inertia", "1,2,0,0,1,0,0,0,1"], "--inertia: not symmetric"),
    (["--tip-off", "60"], "expected at most 10.9 deg/s: the wheels take 0.01 N m s"),
    (["--cells", "+x,foo"], "--cells: 'foo' given, expected a face"),
    (["--cells", ",".join(["+x"] * 200)], "--cells: 200 directions given, expected 1 to 32"),
    (["--out", "/proc/none/mine.yaml"], "/proc/none/mine.yaml: cannot be written: No such file or directory"),
    (["--array-normal", "up"], "--array-normal: 'up' given, expected a face"),
    (["--orbit", "tle nowhere.tle"], "--orbit: nowhere.tle: cannot be read"),
    (["--epoch", "2060-01-01"], "mission.epoch: 2060-01-01T00:00:00Z given"),
    (["--template", "9u"], "--template: '9u' given, expected one of 1u, 3u"),
    (["--out", "mine.txt"], "--out: mine.txt given, expected a file that ends in .yaml"),
]


@pytest.mark.parametrize(("arguments", "words"), WRONG, ids=lambda value: " ".join(value)[:30])
def test_what_is_wrong_is_one_line_and_no_file(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert new.main(["mine", *arguments]) == USAGE
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert list(tmp_path.iterdir()) == []


def test_names_and_files_are_guarded(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("a/b", "", "mine.yaml", "."):
        assert new.main([name]) == USAGE
    (tmp_path / "mine.yaml").write_text("precious")
    assert new.main(["mine"]) == USAGE
    assert (tmp_path / "mine.yaml").read_text() == "precious"
    assert new.main(["mine", "--overwrite"]) == 0
    assert "precious" not in (tmp_path / "mine.yaml").read_text()
    assert "is there already" in capsys.readouterr().err


def test_of_two_at_once_one_says_that_the_file_is_there(tmp_path, monkeypatch, capsys):
    """The other one writes between the first look and the end."""
    monkeypatch.chdir(tmp_path)
    designed = new_verb.new_mission

    def slow(*arguments):
        made = designed(*arguments)
        (tmp_path / "mine.yaml").write_text("of the other")
        return made

    monkeypatch.setattr(new_verb, "new_mission", slow)
    assert new.main(["mine", "--yes"]) == USAGE
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "new: error: mine.yaml: is there already, expected a new file, another --out or --overwrite"
    assert (tmp_path / "mine.yaml").read_text() == "of the other"


def test_json_and_list(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert new.main(["--list"]) == 0
    assert set(TEMPLATES) == {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    assert new.main(["mine", "--wheels", "4", "--json"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert told["gains"]["gain_margin_db"] >= 12.0 and told["gains"]["bandwidth_hz"] > 0.0
    assert "wheels" not in told["assumed"] and "mass" in told["assumed"]


def test_doubtful_designs_are_written_with_a_warning(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert new.main(["mine", "--cells", "+x"]) == 1
    told = capsys.readouterr()
    assert "no cell sees 50.0 % of the sky" in told.err and (tmp_path / "mine.yaml").exists()


class Dialogue:
    """Answers questions by the name in the prompt."""

    def __init__(self, answers):
        self.answers, self.said, self.asked = {name: list(given) for name, given in answers.items()}, [], []

    def read_line(self, prompt):
        name = prompt.strip().partition(" (")[0].partition(" [")[0]
        self.asked.append(name)
        given = self.answers.get(name, [])
        return given.pop(0) if given else ""


def test_questions_have_units_and_defaults_and_are_asked_again_after_nonsense():
    talk = Dialogue({"mass": ["heavy", "2.5"], "wheels": ["none"]})
    answers = ask({"orbit": "sso 600 06:00"}, "3u", talk.read_line, talk.said.append)
    assert answers == {"mass": "2.5", "wheels": "none"}
    assert talk.asked.count("mass") == 2 and "orbit" not in talk.asked
    assert "wheel momentum" not in talk.asked  # of wheels that are not there
    assert any("expected a number from" in line for line in talk.said)
    assert any("[kg]" in line for line in talk.said)


def test_nothing_is_asked_when_nobody_can_answer(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("builtins.input", lambda prompt: pytest.fail("asked"))
    assert new.main(["mine"]) == 0


def test_answers_that_end_early_are_an_error(tmp_path, monkeypatch, capsys):
    def ends(prompt):
        raise EOFError

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", ends)
    assert new.main(["mine"]) == USAGE
    assert "the answers ended" in capsys.readouterr().err
    assert new.main(["mine", "--yes"]) == 0


def test_numbers_are_written_as_ros_reads_them():
    numbers = {1.0: "1.0", 1e-6: "1.0e-06", -0.0: "0.0", 123456.5: "123456.5", 1e20: "1.0e+20"}
    assert {value: number_word(value) for value in numbers} == numbers
    text = parameter_file("A heading.", [("/**", [Entry("mission.name", "it's", "word"), Entry("mission.seed", 1)])])
    assert text == '# A heading.\n/**:\n  ros__parameters:\n    mission:\n      name: "it\'s"  # word\n      seed: 1\n'


def test_a_template_that_is_not_there():
    with pytest.raises(DesignError, match="--template"):
        read_items({}, "none")
