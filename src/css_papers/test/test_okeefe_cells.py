# SPDX-License-Identifier: Apache-2.0
"""Outputs of cells for Figs. 3 and 5 of O'Keefe & Schaub 2013, against closed forms."""

import numpy as np
import pytest
from matplotlib.image import AxesImage
from matplotlib.text import Text

from css_analysis.flight_log import to_body
from css_common.mission import load_mission
from css_environment.mission_environment import MissionEnvironment
from css_environment.reflectivity import HIGHEST, LOWEST, zonal_reflectivity
from css_papers.cell_outputs import albedo_peaks, orbit_outputs, response, sun_pointing
from css_papers.okeefe import cell_figures

MISSION = load_mission("okeefe_2013")
SHORT = MISSION.with_overrides(["mission.duration=600"])


def test_the_response_is_the_cosine_and_equation_16():
    curve = response(MISSION)
    cosine = np.cos(np.radians(curve.angle_deg))
    inside = np.abs(curve.angle_deg) < 59.99
    np.testing.assert_allclose(curve.ideal[inside], cosine[inside], atol=1e-12)
    assert np.all(curve.ideal[np.abs(curve.angle_deg) > 60.01] == 0.0)
    beta = np.sin(np.arccos(curve.ideal[inside]))
    np.testing.assert_allclose(
        curve.warped[inside], curve.ideal[inside] * (1.0 + 0.5 * beta**2 - 0.65 * beta**4), atol=1e-12
    )
    np.testing.assert_allclose(curve.degraded, 0.95 * curve.warped)


@pytest.mark.parametrize(
    ("draw", "words"),
    [("mean", "not used: every case flies with the mean"), ("common", "drawn for each case"), ("per_cell", "drawn")],
)
def test_the_map_of_reflectivity_shows_what_flies_and_says_whether_it_is_drawn(draw, words, tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(cell_figures, "save", lambda figure, file: figures.append(figure))
    mission = MISSION.with_overrides([f"css_array.albedo.draw={draw}", "css_array.albedo.factor=0.5"])
    cell_figures.write_reflectivity(mission, tmp_path / "map.png")
    texts = [text.get_text() for text in figures[0].findobj(Text)]
    assert "factor 0.5 included" in texts
    assert any(text.startswith(words) for text in texts)
    mean, deviation = (image.get_array() for image in figures[0].findobj(AxesImage))
    assert 0.5 * LOWEST <= mean.min() < mean.max() <= 0.5 * HIGHEST
    zonal = zonal_reflectivity(1)
    np.testing.assert_allclose(deviation[:, :1], 0.5 * zonal.std)
    if draw == "mean":
        np.testing.assert_allclose(mean[:, :1], 0.5 * zonal.mean)


@pytest.mark.parametrize("sun_n", [(1.0, 0.0, 0.0), (0.6, 0.0, -0.8), (-0.48, 0.6, 0.64)])
def test_pointing_puts_the_array_normal_on_the_sun(sun_n):
    vectors_n = np.array([sun_n, (0.0, 0.0, 1.0)])
    sun_b, pole_b = to_body(np.tile(sun_pointing(sun_n), (2, 1)), vectors_n)
    np.testing.assert_allclose(sun_b, (0.0, 0.0, 1.0), atol=1e-12)
    assert pole_b[0] > 0.0 and pole_b[1] == pytest.approx(0.0, abs=1e-12)


def test_on_the_sun_the_direct_light_is_the_cosine_of_45_deg():
    outputs = orbit_outputs(SHORT, step_s=60.0)
    environment = MissionEnvironment(MISSION.values, field=False)
    flux = [environment.at(float(time)).solar_flux for time in outputs.time_s]
    # in ten minutes the Sun moves by 1.2e-4 rad, a cell at 45 deg then reads other by that share
    np.testing.assert_allclose(outputs.direct[:, :4], np.sqrt(0.5) * np.outer(flux, np.ones(4)), rtol=1.3e-4)
    np.testing.assert_allclose(outputs.direct[0, :4], np.sqrt(0.5) * flux[0], rtol=1e-12)
    assert np.all(outputs.direct[:, 4:] == 0.0)
    # cells on the far side see the sunlit Earth below, those on the near side do not
    assert outputs.albedo.min() >= -1e-15 and outputs.albedo[:, 4:].max() > 0.1


def test_light_of_the_earth_is_in_proportion_to_its_reflectivity():
    half = SHORT.with_overrides(["css_array.albedo.factor=0.5"])
    whole = SHORT.with_overrides(["css_array.albedo.factor=1"])
    np.testing.assert_allclose(
        orbit_outputs(whole, step_s=60.0).albedo, 2.0 * orbit_outputs(half, step_s=60.0).albedo, atol=1e-6
    )
    np.testing.assert_allclose(albedo_peaks(whole, 3), 2.0 * albedo_peaks(half, 3), rtol=1e-5)
