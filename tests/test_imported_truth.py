# SPDX-License-Identifier: Apache-2.0
"""Imported telemetry with its truth: errors of estimates are told, what nobody gave is not made up."""

import json

import pytest
from faces import LINES, recording

from css_bringup.commands import replay as command


@pytest.fixture
def bag(tmp_path):
    return recording(tmp_path, lambda k, face, value: f"{value:.9f}")


def replay(bag, capsys, *estimators: str) -> tuple[dict, str]:
    """JSON object and screen of a replay."""
    out = bag.with_name(f"{bag.name}_replayed")
    assert command.main([str(bag), "--out", str(out), "--json", "--estimators", *estimators]) == 0
    *screen, last = capsys.readouterr().out.splitlines()
    return json.loads(last), " ".join(" ".join(screen).split())


def test_errors_count_over_all_lines_and_nothing_is_told_of_arrays_that_nobody_described(bag, capsys):
    result, screen = replay(bag, capsys, "ekf", "wls:gate=0", "wavg")
    ekf, wls, wavg = result["runs"]
    assert ekf["heading_error_mean_deg"] < 0.001 and ekf["heading_error_p95_deg"] < 0.001
    # two lines with two lit cells, on the spot where the third is at right angles
    assert wls["heading_error_mean_deg"] < 0.001
    # of cells at right angles that all count, the weighted average is the direction itself
    assert wavg["heading_error_mean_deg"] < 0.001
    for run in result["runs"]:
        assert run["steps_without_estimate"] == 0
        for quantity in ("power_positive_s", "pointing_error_mean_deg", "pointing_error_sunlit_deg"):
            assert run[quantity] is None
        assert run["rate_final_deg_s"] == pytest.approx(1.0)
    assert result["simulated_s"] == LINES - 1
    assert "imported telemetry: errors over all lines" in screen
    assert "mission: " in screen and "embedded mission" in screen


def test_an_orbit_that_nobody_gave_is_asked_for(bag, capsys):
    assert command.main([str(bag), "--out", str(bag.with_name("refused")), "--estimators", "ekf", "flat"]) == 2
    assert "flat: orbit.source: missing, expected one of elements, tle, ballistic" in capsys.readouterr().err
    result, _ = replay(bag, capsys, "ekf", "flat:eclipse.source=sensors")
    assert [run["notes"] for run in result["replayed"]] == [[], []]
