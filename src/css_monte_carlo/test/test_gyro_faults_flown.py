# SPDX-License-Identifier: Apache-2.0
"""Flights with a gyro that lies, and with a right one, to the last bit as without its health."""

import numpy as np
import pytest

from css_common.mission import load_mission
from css_monte_carlo.study import Configuration, run_study

CASES = 6
FAULTS = {
    "none": (),
    "bias": ("faults.f.target=gyro.all", "faults.f.kind=bias", "faults.f.offset=1.0"),
    "step": ("faults.f.target=gyro.x", "faults.f.kind=bias", "faults.f.offset=5.0", "faults.f.time=100.0"),
    "sign": ("faults.f.target=gyro.y", "faults.f.kind=sign", "faults.f.time=20.0"),
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """Columns of the cases by health on or off and fault."""
    mission = load_mission("okeefe_2013", ["mission.duration=700.0"])
    columns = {}
    for health in ("true", "false"):
        configurations = {
            name: Configuration("ekf", True, (f"ekf.health.enabled={health}", *lines)) for name, lines in FAULTS.items()
        }
        study = run_study(mission, list(configurations.values()), CASES, tmp_path_factory.mktemp("study") / health)
        rows = study.cases.to_pylist()
        for name, configuration in configurations.items():
            wanted = configuration.columns["overrides"]
            columns[health, name] = [row for row in rows if row["overrides"] == wanted]
    return columns


def column(rows, name):
    return np.array([np.nan if row[name] is None else row[name] for row in rows], dtype=np.float64)


def test_a_right_gyro_is_flown_to_the_last_bit_as_without_its_health(studies):
    for name in ("heading_error_mean_deg", "acquired_s", "wheel_momentum_final", "nis_mean"):
        np.testing.assert_array_equal(
            column(studies["true", "none"], name), column(studies["false", "none"], name), err_msg=name
        )


@pytest.mark.parametrize("fault", ["bias", "step", "sign"])
def test_a_gyro_that_lies_costs_little_once_it_is_found(studies, fault):
    right, left_alone, flown = studies["true", "none"], studies["false", fault], studies["true", fault]
    name = "heading_error_sunlit_deg"
    assert np.nanmean(column(left_alone, name)) > 2.0 * np.nanmean(column(right, name))
    acquired = [int(np.isfinite(column(rows, "acquired_s")).sum()) for rows in (left_alone, flown)]
    assert acquired[1] >= acquired[0]
    assert np.nanmean(column(flown, "pointing_error_sunlit_deg")) < np.nanmean(
        column(left_alone, "pointing_error_sunlit_deg")
    )


def test_a_step_is_flown_as_a_right_gyro(studies):
    name = "heading_error_sunlit_deg"
    assert np.nanmean(column(studies["true", "step"], name)) < 1.5 * np.nanmean(column(studies["true", "none"], name))
