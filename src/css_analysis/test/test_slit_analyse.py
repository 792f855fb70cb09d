# SPDX-License-Identifier: Apache-2.0
"""The tool for files of pulses: the products of the flight, one line for what is wrong with a file."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from spinning import STEADY, motion_of, pulses_of, sun_over_andoya

from css_analysis.commands.slit_analyse import main
from css_analysis.slit_file import SlitFileError, read_slit_file
from css_common.command import FAILED, USAGE

NAMES = ("upper", "vertical", "lower")


@pytest.fixture(scope="module")
def pulse_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("pulses") / "flight.csv"
    pulses = pulses_of(motion_of(**STEADY), sun_over_andoya(), 0.0, 30.0)
    path.write_text("# a flight\nslit,count\n" + "".join(f"{NAMES[s]},{c}\n" for s, c, _ in pulses), encoding="utf-8")
    return path


def run(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_products_of_a_file(pulse_file, tmp_path, capsys):
    table = tmp_path / "passages.csv"
    code, out, _ = run(
        capsys, pulse_file, "--inertia-ratio", 0.7, "--json", "--figures", tmp_path / "f", "--passages", table
    )
    assert code == 0
    result = json.loads(out.splitlines()[-1])
    assert result["rotation_rate_hz"]["mean"] == pytest.approx(5.45, rel=0.005)
    coning = result["windows"][0]["coning"]
    assert coning["full_angle_deg"] == pytest.approx(12.89, abs=0.3)
    assert coning["period_s"] == pytest.approx(0.2618, abs=coning["period_resolution_s"])
    assert len(coning["candidates"]) == 4
    assert "nearest to the given one" in coning["because"]
    assert {file.name for file in (tmp_path / "f").iterdir()} == {
        "rate_and_sun_angle.png", "coning_angle.png", "spectrum.png",
    }  # fmt: skip
    lines = table.read_text().splitlines()
    assert lines[0] == "time_s,rotation_rate_hz,sun_angle_deg,sun_angle_sigma_deg"
    assert len(lines) == 1 + result["passages"]


def test_what_the_pulses_leave_open_is_said_and_the_exit_code_knows(pulse_file, capsys, monkeypatch):
    monkeypatch.setattr("css_estimation.spin.coning.fit_motion", lambda *arguments: None)
    code, out, err = run(capsys, pulse_file, "--inertia-ratio", 1.0, "--json")
    assert code == FAILED
    assert err == "slit_analyse: error: coning, 0.25 to 29.97 s: the period is ambiguous, see the candidates\n"
    coning = json.loads(out.splitlines()[-1])["windows"][0]["coning"]
    assert (coning["chosen"], coning["rivals"]) == (1, [2])
    (rival,) = [line for line in out.splitlines() if "as good" in line]
    assert "0.1412" in rival
    assert "ambiguous, 0.1412 s may as well be" in out
    code, _, err = run(capsys, pulse_file, "--inertia-ratio", 0.7)
    assert (code, err) == (0, "")


def test_windows_are_analysed_one_by_one(pulse_file, capsys):
    code, out, _ = run(capsys, pulse_file, "--window", "0:15", "--window", "15:30", "--window", "29:30", "--json")
    assert code == 0
    windows = json.loads(out.splitlines()[-1])["windows"]
    assert [w["coning"] is None for w in windows] == [False, False, True]
    assert all(w["coning"]["chosen"] == 1 for w in windows[:2])  # by the pulses: nothing was given


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "slit,count\nupper,12\nlower,1.5\n",
            "line 3: count '1.5' given, expected a whole number from 0 to 4294967295",
        ),
        ("slit,count\nupper,12\nleft,15\n", "line 3: slit 'left' given, expected upper, vertical or lower"),
        ("slit,count\n\n# note\nupper\n", "line 4: 1 values given, expected 2"),
        ("slit,ticks\nupper,12\n", "line 1: no column 'count'"),
        ("slit,count,head\nupper,12,1\n", "line 2: head '1' given, expected a whole number from 0 to 0"),
        ("slit,count\nupper,4294967296\n", "line 2: count '4294967296'"),
        ('slit,count\n"upper,3\n', "line 2: unexpected end of data"),
        ("slit,count\n", "no pulses"),
        ("", "no pulses"),
    ],
)
def test_a_broken_file_is_named_with_its_line(text, message, tmp_path, capsys):
    path = tmp_path / "broken.csv"
    path.write_text(text, encoding="utf-8")
    code, out, err = run(capsys, path)
    assert (code, out) == (USAGE, "")
    assert err.startswith(f"slit_analyse: error: {path}: ")
    assert message in err
    assert len(err.splitlines()) == 1


def test_a_missing_file_and_wrong_options_are_one_line(pulse_file, tmp_path, capsys):
    for arguments, message in (
        ((tmp_path / "none.csv",), "cannot be read"),
        ((pulse_file, "--window", "30:2"), "expected START:END"),
        ((pulse_file, "--frequency", "-1"), "slits.counter_hz"),
        ((pulse_file, "--head-azimuths-deg", "0,0"), "two heads at one place"),
    ):
        code, _, err = run(capsys, *arguments)
        assert code == USAGE
        assert message in err
        assert len(err.splitlines()) == 1


def test_pulses_without_a_passage_say_why(tmp_path, capsys):
    path = tmp_path / "upper.csv"
    path.write_text("slit,count\n" + "".join(f"U,{180_000 * i}\n" for i in range(1, 9)), encoding="utf-8")
    code, _, err = run(capsys, path)
    assert code == FAILED
    assert "a slit gave no pulse" in err


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("any") / "any.csv"
    path.write_text("slit,count\n" + text, encoding="utf-8", errors="replace")
    try:
        pulses = read_slit_file(path)
    except SlitFileError as error:
        assert "\n" not in str(error)
    else:
        assert all(0 <= count < 2**32 for _, count, _ in pulses)


def test_a_slit_may_be_its_first_letter_in_either_case(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text("count,slit,note\n5,U,a\n6, v ,b\n7,Lower,c\n", encoding="utf-8")
    assert read_slit_file(path) == [(0, 5, 0), (1, 6, 0), (2, 7, 0)]
