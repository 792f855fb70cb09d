# SPDX-License-Identifier: Apache-2.0
"""Cells against Basilisk's CoarseSunSensor in what both model: view, distance, eclipse, albedo, scale, bias, limits.

Basilisk adds its bias in front of the scale factor and fails cells there too; the mapping below says so. Its
"kelly" curve has no counterpart here, so those ten cases are left out.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values

from css_common.attitude import mrp_to_dcm
from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_common.vectors import multiply
from css_sensors.cells import CELLS
from css_sim import cell_errors, cell_faults, cell_screen, sun_cells
from css_sim.faults import rows

REFERENCE = json.loads((Path(__file__).parent / "data" / "coarse_sun_sensor.json").read_text())
CASES = [case for case in REFERENCE["cases"] if case["kellyFactor"] == 0.0]


def outputs(case, faults=()):
    """Our output for a Basilisk case."""
    values = okeefe_values(
        MISSION + CELLS + sun_cells.PARAMETERS + cell_faults.PARAMETERS + cell_screen.PARAMETERS,
        cells__normals=case["nHat_B"],
        cells__field_of_view_deg=min(180.0, math.degrees(2.0 * case["fov"])),
        cells__clip_normal=[0.0, 0.0, 0.0],
        warp=False,
        degradation=0.0,
        output_low=case["minOutput"],
        output_high=min(10.0, case["maxOutput"]),
        faults=list(faults),
    )
    cells = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    cells["gain"] = case["scaleFactor"]
    cells["bias"] = case["senBias"] * case["scaleFactor"]
    sun_line = np.array(case["r_SN_N"]) - case["r_BN_N"]
    distance = np.linalg.norm(sun_line)
    sun_b = multiply(mrp_to_dcm(tuple(case["sigma_BN"])), tuple(sun_line / distance))
    np.testing.assert_allclose(sun_b, case["sHat_B"], atol=1e-15)
    intensity = case["illuminationFactor"] * (REFERENCE["AU_m"] / distance) ** 2
    voltage = np.zeros(1)
    key = random_key(1, 0)
    sun_cells.sample(
        sun_cells.parameters(values), cells, rows(cell_faults.case_faults(values, key)), key, 0, sun_b, intensity,
        np.array([case["albedo"]]), voltage,
    )  # fmt: skip
    return voltage[0]


@pytest.mark.parametrize("index", [i for i, c in enumerate(CASES) if c["fault"] == "NOMINAL"])
def test_healthy_cell(index):
    case = CASES[index]
    assert outputs(case) == pytest.approx(case["sensedValue"], abs=1e-14)


@pytest.mark.parametrize("index", [i for i, c in enumerate(CASES) if c["fault"] != "NOMINAL"])
def test_failed_cell(index):
    case = CASES[index]
    fault = {
        "OFF": "0 dead",
        "STUCK_MAX": f"0 stuck {case['scaleFactor']!r}",
        "STUCK_CURRENT": f"0 stuck {case['sensedValue']!r}",
    }[case["fault"]]
    assert outputs(case, [fault]) == pytest.approx(case["sensedValue"], abs=1e-14)


def test_reference_covers_every_effect():
    assert len(CASES) == 70
    assert {c["fault"] for c in CASES} == {"NOMINAL", "OFF", "STUCK_MAX", "STUCK_CURRENT"}
    assert sum(c["illuminationFactor"] < 1.0 for c in CASES) >= 5
    assert sum(c["albedo"] > 0.0 for c in CASES) >= 5
