# SPDX-License-Identifier: Apache-2.0
"""The command `export`: what it writes and says, and what it refuses in one line."""

import json
import shutil
from pathlib import Path

import pytest

from css_common.command import DONE, FAILED, USAGE
from css_export.commands import export

REFERENCE = Path(__file__).parents[3] / "bags" / "reference"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["okeefe_2013", "--components", "efk"], "did you mean ekf"),
        (["okeefe_2013", "--components", "gyro"], "expected one of ekf, mrp_control"),
        (["okeefe_2013", "--target", "aarch65"], "did you mean aarch64"),
        (["okeefe_2013", "--verify", "/nowhere/at/all"], "/nowhere/at/all"),
        (["okeefe_2013", "--verify", str(REFERENCE), "--set", "ekf.gate=0.5"], "ekf.gate was 0.4 in flight"),
        (["esprit_2006", "--verify", str(REFERENCE)], "did not fly"),
        (["no_such_mission"], "no_such_mission"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(arguments, said, tmp_path, capsys):
    assert export.main([*arguments, "-o", str(tmp_path / "out")]) == USAGE
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [["--steps", "10"], ["--steps", "0", "--verify", str(REFERENCE)]])
def test_steps_without_a_flight_are_none(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        export.main(["okeefe_2013", *arguments])
    assert ended.value.code == USAGE
    assert "--steps" in capsys.readouterr().err


def test_an_export_and_what_it_says(tmp_path, capsys):
    code = export.main(["esprit_2006", "--target", "cortex-m7", "-o", str(tmp_path), "--json"])
    out = capsys.readouterr().out
    assert code == DONE
    told = json.loads(out.splitlines()[-1])
    assert list(told["left_out"]) == ["coning"]
    names = [result["component"] for result in told["results"]]
    assert names == ["slit_sun_angle_take_pulse", "slit_sun_angle_measure", "triad"]
    for result in told["results"]:
        assert result["target"] == "cortex-m7"
        assert result["steps"] is result["equal_steps"] is result["largest_relative_difference"] is None
        assert result["code_bytes"] > 0
        assert result["data_bytes"] == 0
        folder = tmp_path / result["component"]
        prefix = f"sunpoint_{result['component']}"
        written = {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()}
        assert {f"{prefix}.h", f"{prefix}_main.c", "Makefile", "CMakeLists.txt", "README.md"} <= written
        assert {f"cortex-m7/{prefix}.o", f"cortex-m7/lib{prefix}.a"} <= written
        assert str(result["code_bytes"]) in (folder / "README.md").read_text()
    assert "coning: left out: it fits whole legs" in out


@pytest.mark.skipif(shutil.which("gcc") is None or shutil.which("make") is None, reason="gcc or make is not installed")
def test_the_makefile_builds_the_program(tmp_path, capsys):
    import subprocess

    arguments = ["esprit_2006", "--components", "slit_sun_angle", "-o", str(tmp_path)]
    assert export.main(arguments) == DONE
    folder = tmp_path / "slit_sun_angle_take_pulse"
    subprocess.run(["make", "-C", str(folder), "CFLAGS=-std=c99 -Wall -Wextra -Wpedantic -Werror"], check=True)
    program = folder / "x86_64" / "sunpoint_slit_sun_angle_take_pulse_main"
    assert subprocess.run([str(program)], input=b"", check=True, capture_output=True).stdout == b""
    capsys.readouterr()


SLITS = "slit_sun_angle_take_pulse"


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_what_lies_there_of_another_export_is_not_left_in_silence(tmp_path, capsys):
    """Its objects have other parameters than the header beside them says."""
    arguments = ["esprit_2006", "--components", "slit_sun_angle", "-o", str(tmp_path)]
    assert export.main(arguments) == DONE
    folder = tmp_path / SLITS
    program = folder / "x86_64" / f"sunpoint_{SLITS}_main"
    program.write_text("linked with what lies there")
    capsys.readouterr()
    assert export.main([*arguments, "--target", "aarch64", "--set", "slits.inclination_deg=31"]) == FAILED
    said = capsys.readouterr().out
    assert f"{folder / 'x86_64' / f'libsunpoint_{SLITS}.a'}: of another export" in said
    assert export.main([*arguments, "--target", "x86_64", "aarch64", "--set", "slits.inclination_deg=31"]) == DONE
    assert not program.exists()
