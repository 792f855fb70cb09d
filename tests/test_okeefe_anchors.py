# SPDX-License-Identifier: Apache-2.0
"""Figures that O'Keefe & Schaub 2013 state of their orbit, from the mission as it flies."""

import numpy as np
import pytest

from css_common.attitude import mrp_to_dcm
from css_common.mission import load_mission
from css_common.random_streams import Stream, normal4, random_key
from css_environment.albedo import albedo_output, new_workspace
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_environment.mission_environment import MissionEnvironment
from css_sim import cell_errors, cell_screen, earth_reflectivity

MISSION = load_mission("okeefe_2013")


@pytest.fixture(scope="module")
def environment() -> MissionEnvironment:
    return MissionEnvironment(MISSION.node("dynamics").values, field=False)


def test_sunlight_per_orbit_is_56_and_a_half_minutes(environment):
    sunlit = [environment.at(t).illumination for t in np.arange(0.0, 5550.0, 1.0)]
    assert sum(sunlit) / 60.0 == pytest.approx(56.5, abs=0.5)


def test_albedo_reaches_a_quarter_of_the_sun(environment):
    """Their Fig. 5a: about 25 % of the output in direct sunlight."""
    values = MISSION.node("css_array").values
    key = random_key(1, 0)
    reflectivity = earth_reflectivity.case_reflectivity(
        values, earth_reflectivity.source(values, MISSION.epoch_ns), key
    )
    cells = cell_errors.nominal_cells(values.cells.normals, cell_screen.cell_sides(values))
    screen = cell_screen.screen(values)
    cos_half_view = float(np.cos(np.radians(values.cells.field_of_view_deg / 2.0)))
    view, light, work, output = new_earth_view(), new_light(), new_workspace(), np.zeros(len(cells))
    largest = 0.0
    for step, t in enumerate(np.arange(0.0, 5550.0, 30.0)):
        here = environment.at(float(t))
        albedo_sources(view, here.r_n, here.sun_n, here.solar_flux, here.dcm_en, reflectivity, light)
        for turn in range(60):
            q = np.array(normal4(key, Stream.INITIAL_ATTITUDE, step, turn))
            q /= np.linalg.norm(q) * (1.0 if q[3] >= 0.0 else -1.0)
            sigma = tuple((q[:3] / (1.0 + q[3])).tolist())
            albedo_output(light, cells, screen, cos_half_view, mrp_to_dcm(sigma), work, output)
            largest = max(largest, float(output.max()))
    assert 0.20 <= largest <= 0.30
