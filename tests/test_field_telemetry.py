# SPDX-License-Identifier: Apache-2.0
"""Tables as people have them, with the answers that are right for them: six faces of a cubesat, the Sun 30 deg up,
turning about z at 1 deg/s, neither noise nor light of the Earth.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from flights import samples
from sensor_msgs.msg import Imu, MagneticField

from css_analysis.estimate_errors import heading_errors, tangent_nees
from css_bringup.replay_bag import ReplayResult, mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_msgs.msg import CssVoltages, SpacecraftState
from css_telemetry.commands.import_csv import main

FIELD = Path(__file__).with_name("field_telemetry")
LAYOUT = FIELD / "layout.yaml"
FACES = "".join(f"  css_{f}: [{n}]\n" for f, n in (
    ("px", "1, 0, 0"), ("mx", "-1, 0, 0"), ("py", "0, 1, 0"), ("my", "0, -1, 0"), ("pz", "0, 0, 1"), ("mz", "0, 0, -1"),
))  # fmt: skip
DESCRIBED = f"cells:\n{FACES}field_of_view_deg: 180\n"
QUATERNION = """\
aiding:
  field: {columns: [mag_x, mag_y, mag_z], unit: T}
truth:
  attitude: {columns: [q_x, q_y, q_z, q_w], order: xyzw, direction: inertial_to_body}
  sun_inertial: [0.866025, 0, 0.5]
"""
CHI_SQUARE = 18.4
"""99.99 % of chi-square with two degrees of freedom."""
LONG = "table: {long: {name: cell, value: value}}\n"


def imported(name: str, tmp_path: Path, capsys, *options: str, text: str | None = None) -> tuple[int, dict, Path]:
    """Exit code, JSON object and folder of an import by the layout, or by a description of this text."""
    layout = LAYOUT
    if text is not None:
        layout = tmp_path / "description.yaml"
        layout.write_text(text)
    bag = tmp_path / "bag"
    code = main([str(FIELD / name), str(layout), "-o", str(bag), "--json", *options])
    return code, json.loads(capsys.readouterr().out.splitlines()[-1]), bag


def replayed(bag: Path, *requests: str) -> ReplayResult:
    mission = mission_of_bag(bag, {}, [], None)
    return replay(bag, bag.with_name("replay"), mission, map(parse_request, requests), {}, overwrite=True)


def worst_deg(result: ReplayResult, name: str) -> float:
    _, errors = heading_errors(result.log, name)
    return math.degrees(errors.max())


# file, options, description, lines used, refused, exit code
READ = {
    "01_base": ([], None, 120, 0, 0),
    "03_semicolon_decimal_comma": ([], None, 15, 0, 0),
    "04_unix_ms": ([], None, 15, 0, 0),
    "06_iso_doy": ([], None, 15, 0, 0),
    "12_counts": ([], DESCRIBED + "full_scale: 3000\ndark_level: 100\n", 15, 0, 0),
    "14_header_units": ([], None, 15, 0, 0),
    "19_one_time_far_ahead": ([], None, 14, 1, 1),
    "24_sentinels": ([], None, 15, 0, 0),
    "31_quaternion": ([], DESCRIBED + QUATERNION, 15, 0, 0),
    "32_space": ([], None, 15, 0, 0),
    "36_latin1": (["--skip-bad"], None, 15, 0, 0),
    "42_mA": (["--full-scale", "0.0025"], None, 15, 0, 0),
    "49_timestamp_name": ([], None, 15, 0, 0),
    "55_rates_dps": ([], None, 15, 0, 0),
    "61_clock_set_back": ([], None, 100, 20, 1),
    "70_static_six_faces": ([], None, 120, 0, 0),
}


@pytest.mark.parametrize("name", READ)
def test_the_heading_is_right_in_every_line(name, tmp_path, capsys):
    options, text, used, refused, code = READ[name]
    given, told, bag = imported(f"{name}.csv", tmp_path, capsys, *options, text=text)
    assert given == code
    assert told["lines"] == {"read": used + refused, "used": used, "refused": refused}
    if "--skip-bad" not in options and refused:
        assert imported(f"{name}.csv", tmp_path, capsys, *options, "--skip-bad", "--overwrite", text=text)[0] == 0
    result = replayed(bag, "ekf", "wls")
    # readings of whole counts are half a count of 3000 off
    limit = 0.1
    for estimator in ("ekf", "wls"):
        steps, _ = heading_errors(result.log, estimator)
        assert len(steps) == used
    if name == "31_quaternion":
        # without a gyro the filter finds out by the cells that the body turns
        assert np.all(tangent_nees(result.log, "ekf")[1] < CHI_SQUARE)
    else:
        assert worst_deg(result, "ekf") < limit
    # where a missing cell leaves less than the direction, least squares cannot know it
    if name != "24_sentinels":
        assert worst_deg(result, "wls") < limit


def test_times_are_those_of_the_table(tmp_path, capsys):
    for options in ([], ["--time-unit", "ms"]):
        told = imported("04_unix_ms.csv", tmp_path, capsys, "--overwrite", *options)[1]
        assert told["first_utc"] == "2023-11-14T22:13:20Z"
        guess = "times in ms, a guess: 1700000000000 ms since 1970 is a time of our days (--time-unit tells it)"
        assert (guess in told["read_as"]) == (not options)
    told = imported("06_iso_doy.csv", tmp_path, capsys, "--overwrite")[1]
    assert (told["first_utc"], told["last_utc"]) == ("2024-01-01T00:00:00Z", "2024-01-01T00:00:14Z")
    # of a clock that was set back the longer stretch is good
    told = imported("61_clock_set_back.csv", tmp_path, capsys, "--overwrite")[1]
    assert (told["first_utc"], told["span_s"]) == ("2023-11-14T22:13:40Z", 99.0)
    assert told["refused"] == [{"kind": "time does not go forward", "count": 20, "first_line": 2}]
    told = imported("19_one_time_far_ahead.csv", tmp_path, capsys, "--overwrite")[1]
    assert told["refused"] == [{"kind": "time does not go forward", "count": 1, "first_line": 11}]


def test_rates_in_degrees_and_fill_values(tmp_path, capsys):
    _, _, bag = imported("55_rates_dps.csv", tmp_path, capsys)
    rates = [sample.angular_velocity for sample in samples(bag, "/gyro/imu", Imu)]
    np.testing.assert_allclose(rates, [(0.0, 0.0, math.radians(1.0))] * 15, rtol=1e-12)
    _, told, bag = imported("24_sentinels.csv", tmp_path, capsys, "--overwrite")
    assert [(f["value"], f["count"]) for f in told["fill_values"]] == [(-9999.0, 2), (65535.0, 1)]
    outputs = np.stack([sample.voltages for sample in samples(bag, "/css/voltages", CssVoltages)])
    assert np.isnan(outputs).sum() == 3 and np.nanmax(outputs) < 1.0 and np.nanmin(outputs) >= 0.0


def test_attitude_is_truth_and_field_is_aiding(tmp_path, capsys):
    _, told, bag = imported("31_quaternion.csv", tmp_path, capsys, text=DESCRIBED + QUATERNION)
    assert told["truth"] == ["sun", "attitude"]
    truth = samples(bag, "/truth", SpacecraftState)
    # the body turns about z at 1 deg/s: sigma = tan(angle / 4)
    angles = [4.0 * math.degrees(math.atan(sample.sigma_bn[2])) for sample in truth]
    np.testing.assert_allclose(angles, np.arange(15.0), atol=1e-3)
    fields = {tuple(sample.magnetic_field) for sample in samples(bag, "/mag/field", MagneticField)}
    assert fields == {(20e-6, 0.0, -30e-6)}
    turned = QUATERNION.replace("inertial_to_body", "body_to_inertial")
    _, _, bag = imported("31_quaternion.csv", tmp_path, capsys, "--overwrite", text=DESCRIBED + turned)
    opposite = samples(bag, "/truth", SpacecraftState)
    np.testing.assert_allclose([a.sigma_bn for a in truth], [-b.sigma_bn for b in opposite], atol=1e-12)


@pytest.mark.parametrize("name", ["22b_nan", "23_one_cell_always_missing"])
def test_a_missing_cell_costs_no_line_and_covariances_say_what_is_open(name, tmp_path, capsys):
    code, told, bag = imported(f"{name}.csv", tmp_path, capsys)
    assert code == 0 and told["lines"] == {"read": 15, "used": 15, "refused": 0}
    (missing,) = told["missing"]
    assert missing["kind"] == "missing cell outputs in the other lines"
    assert (missing["count"], missing["first_line"]) == ((4, 6) if name == "22b_nan" else (15, 2))
    result = replayed(bag, "ekf", "wls")
    for estimator in ("ekf", "wls"):
        steps, _ = heading_errors(result.log, estimator)
        assert len(steps) == 15
        assert np.all(tangent_nees(result.log, estimator)[1] < CHI_SQUARE)
    # least squares of one lit cell has no covariance and says so
    assert len(tangent_nees(result.log, "ekf")[1]) == 15


def test_one_value_a_line(tmp_path, capsys):
    code, told, bag = imported("29_long.csv", tmp_path, capsys, text=DESCRIBED + LONG)
    # the table ends within its third instant
    assert code == 0 and told["lines"] == {"read": 3, "used": 3, "refused": 0}
    base = imported("01_base.csv", tmp_path / "..", capsys, "--overwrite")[2]
    here, there = (samples(folder, "/css/voltages", CssVoltages) for folder in (bag, base))
    for a, b in zip(here, there, strict=False):
        assert a.stamp_ns == b.stamp_ns
        given = np.isfinite(a.voltages)
        assert given.sum() >= 3
        np.testing.assert_array_equal(a.voltages[given], b.voltages[given])


def test_a_name_over_no_field_is_found_by_what_the_others_are_for(tmp_path, capsys):
    """The header names a temperature that no line has; all other names are those of what is read."""
    code, told, _ = imported("36_latin1.csv", tmp_path, capsys)
    assert code == 1 and told["lines"] == {"read": 15, "used": 15, "refused": 0}
    assert told["guessed_form"].startswith("all lines have 13 fields under 14 names; temp °C, which nothing uses, is")
    assert "encoding Latin-1" in told["read_as"]
    # who says so has no doubt
    absent = DESCRIBED + "table: {absent: ['temp °C']}\n"
    code, told, bag = imported("36_latin1.csv", tmp_path, capsys, "--overwrite", text=absent)
    assert code == 0 and told["guessed_form"] == ""
    sun_b = [sample.sun_n for sample in samples(bag, "/truth", SpacecraftState)]
    assert sun_b[0] == pytest.approx([0.866025, 0.0, 0.5], abs=1e-6)


def test_names_over_too_few_fields_are_refused_where_several_may_be_the_one(tmp_path, capsys):
    text = (FIELD / "36_latin1.csv").read_text(encoding="latin-1")
    table = tmp_path / "t.csv"
    # two names that nothing uses, one field too few
    lines = text.replace("temp °C", "temp °C,note", 1).splitlines()
    table.write_text("\n".join([lines[0], *(f"{line},1" for line in lines[1:])]) + "\n")
    assert main([str(table), str(LAYOUT), "-o", str(tmp_path / "bag")]) == 2
    told = capsys.readouterr().err
    assert "line 1: all lines have 14 fields under 15 names: expected as many" in told
    assert "table: {absent: [NAME]}" in told
    # before a description nobody knows which names are used
    assert main([str(FIELD / "36_latin1.csv"), "--describe"]) == 2
    assert "all lines have 13 fields under 14 names" in capsys.readouterr().err
    assert not (tmp_path / "bag").exists()


def test_a_whole_table_in_latin_1(tmp_path, capsys):
    whole = (FIELD / "36_latin1.csv").read_bytes().replace(b",0.0,0.0,1.0,", b",21,0.0,0.0,1.0,")
    (tmp_path / "whole.csv").write_bytes(whole)
    assert main([str(tmp_path / "whole.csv"), str(LAYOUT), "-o", str(tmp_path / "bag")]) == 0
    told = capsys.readouterr().out
    assert "read as: encoding Latin-1" in told and "columns not used: temp °C" in told


@pytest.mark.parametrize(
    ("table", "layout", "words"),
    [
        ("42_mA.csv", "layout.yaml", "the largest cell output is 0.00217, expected about 1"),
        ("12_counts.csv", "layout.yaml", "the largest cell output is 2.7e+03, expected about 1"),
        ("29_long.csv", "layout.yaml", "it has a line for each cell and time"),
        ("one_cell.csv", "lay_dup.yaml", "lay_dup.yaml: line 3: A stands twice"),
        ("one_cell.csv", "lay_facename.yaml", "no column +X, which the description names"),
        ("one_cell.csv", "layout_bool.yaml", "cell CSS_1: 'foo' given, expected a unit vector"),
        ("one_cell.csv", "layout_huge_int.yaml", "cell CSS_1: '1000000"),
        ("time_overflow.csv", "three.yaml", "line 2: column time: '1e999999999' found, expected seconds"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(table, layout, words, tmp_path, capsys):
    (tmp_path / "three.yaml").write_text("cells: {CSS_1: [1, 0, 0], CSS_2: [0, 1, 0], CSS_3: [0, 0, 1]}\n")
    place = FIELD / layout if (FIELD / layout).exists() else tmp_path / layout
    assert main([str(FIELD / table), str(place), "-o", str(tmp_path / "bag")]) == 2
    complaint = capsys.readouterr().err
    assert words in complaint and len(complaint.splitlines()) == 1
    assert not (tmp_path / "bag").exists()


def test_names_of_faces_are_five_cells(tmp_path, capsys):
    (tmp_path / "faces.csv").write_text("time,+X,-X,on,1,01\n1700000000,0.6,0,0.8,0,0.1\n")
    assert main([str(tmp_path / "faces.csv"), str(FIELD / "lay_facename.yaml"), "-o", str(tmp_path / "bag")]) == 0
    capsys.readouterr()
    (sample,) = samples(tmp_path / "bag", "/css/voltages", CssVoltages)
    assert sample.voltages.tolist() == [0.6, 0.0, 0.8, 0.0, 0.1]


SAME_BY_PROPOSAL = [name for name in READ if name not in ("12_counts", "31_quaternion", "36_latin1", "42_mA")]


@pytest.mark.parametrize("name", SAME_BY_PROPOSAL)
def test_the_proposed_description_reads_what_the_layout_does(name, tmp_path, capsys):
    proposal = tmp_path / "proposal.yaml"
    assert main([str(FIELD / f"{name}.csv"), "--describe", "-o", str(proposal)]) == 0
    capsys.readouterr()
    by_layout = imported(f"{name}.csv", tmp_path, capsys, *READ[name][0])[2]
    cells, truth = (
        samples(by_layout, *topic) for topic in (("/css/voltages", CssVoltages), ("/truth", SpacecraftState))
    )
    by_proposal = imported(f"{name}.csv", tmp_path, capsys, "--overwrite", text=proposal.read_text())[2]
    for old, new in zip(cells, samples(by_proposal, "/css/voltages", CssVoltages), strict=True):
        assert old.stamp_ns == new.stamp_ns
        np.testing.assert_array_equal(old.voltages, new.voltages)
    for old, new in zip(truth, samples(by_proposal, "/truth", SpacecraftState), strict=True):
        np.testing.assert_array_equal([old.sun_n, old.omega_bn_b], [new.sun_n, new.omega_bn_b])


COEFFICIENTS = np.array([0.004, -0.003, 0.002, -0.004, 0.003, -0.002])
CALIBRATION = f"""\
/**:
  ros__parameters:
    cells:
      measured: {{temperature_coefficients: {COEFFICIENTS.tolist()}, temperature: 20.0}}
"""


def test_a_calibration_follows_the_temperature_that_is_recorded_and_says_where_there_is_none(tmp_path, capsys):
    """Cells that warm from 20 to 60 deg C while the body turns; every fifth line has their temperature."""
    lines = (FIELD / "01_base.csv").read_text().splitlines()
    names, rows = lines[0].split(","), [line.split(",") for line in lines[1:]]
    at = [names.index(f"css_{face}") for face in ("px", "mx", "py", "my", "pz", "mz")]
    warm = 20.0 + 40.0 * np.arange(len(rows)) / len(rows)
    for k, row in enumerate(rows):
        for i, c in zip(at, COEFFICIENTS, strict=True):
            # a temperature stands until the next is told
            row[i] = f"{float(row[i]) * (1.0 + c * (warm[k - k % 5] - 20.0)):.9f}"
        row.append(f"{warm[k]:.9f}" if k % 5 == 0 else "")
    text = "\n".join(",".join(row) for row in [[*names, "temp"], *rows]) + "\n"
    (tmp_path / "warm.csv").write_text(text)
    (tmp_path / "c.yaml").write_text(CALIBRATION)
    aiding = (
        "aiding: {rate: {columns: [omega_x_deg_s, omega_y_deg_s, omega_z_deg_s], unit: deg/s}, temperatures: [%s]}\n"
    )
    truth = "truth: {sun: {columns: [sun_x, sun_y, sun_z]}}\n"
    worst, told = {}, {}
    for name, temperatures in (("heard", "{column: temp, unit: degC}"), ("deaf", "")):
        described = tmp_path / f"{name}.yaml"
        described.write_text(DESCRIBED + aiding % temperatures + truth)
        bag = tmp_path / name / "bag"
        calibrated = ["--calibration", str(tmp_path / "c.yaml")]
        assert main([str(tmp_path / "warm.csv"), str(described), "-o", str(bag), *calibrated]) == 0
        result = replayed(bag, "ekf", "wls")
        worst[name] = max(worst_deg(result, "ekf"), worst_deg(result, "wls"))
        told[name] = [line for run in result.replayed for line in run.notes]
    assert worst["heard"] < 0.1 and told["heard"] == []
    assert worst["deaf"] > 1.0
    assert len(told["deaf"]) == 2
    assert all(
        "no temperature (css/temperature) was heard at any time, where scales are" in line for line in told["deaf"]
    )
