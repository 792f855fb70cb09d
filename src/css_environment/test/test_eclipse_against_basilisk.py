# SPDX-License-Identifier: Apache-2.0
"""Illumination against Basilisk's vectors, closed forms of the shadow and the paper's sunlit time."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from celestial import orbit_period
from hypothesis import given
from hypothesis import strategies as st

from css_environment.constants import ASTRONOMICAL_UNIT, EARTH_RADIUS, SOLAR_RADIUS
from css_environment.eclipse import conical_illumination, cylindrical_illumination
from css_environment.ephemeris import at, build_ephemeris
from css_environment.orbit import keplerian_orbit

PARITY = json.loads((Path(__file__).parent / "data" / "eclipse.json").read_text())
AU = ASTRONOMICAL_UNIT


def test_conical_shadow_has_basilisks_values():
    seen = []
    for case in PARITY["cases"]:
        line = np.subtract(case["r_SN_N"], case["r_BN_N"])
        distance = float(np.linalg.norm(line))
        fraction = conical_illumination(
            tuple(case["r_BN_N"]),
            tuple(line / distance),
            distance,
            PARITY["REQ_EARTH_m"],
            PARITY["REQ_SUN_m"],
        )
        # The overlap of the discs cancels to about 1e-8 where they just touch.
        assert fraction == pytest.approx(case["illuminationFactor"], abs=2e-8)
        seen.append(fraction)
    assert 0.0 in seen and 1.0 in seen and sum(0.0 < f < 1.0 for f in seen) > 50


@given(st.floats(1.01, 8.0), st.floats(0.0, 2 * math.pi), st.floats(0.0, 2 * math.pi))
def test_illumination_is_a_fraction_and_symmetric_about_the_shadow_axis(radii, angle, turn):
    r, s = radii * EARTH_RADIUS, (1.0, 0.0, 0.0)
    across = r * math.sin(angle)
    flat = conical_illumination((r * math.cos(angle), across, 0.0), s, AU)
    turned = (r * math.cos(angle), across * math.cos(turn), across * math.sin(turn))
    assert 0.0 <= flat <= 1.0
    assert conical_illumination(turned, s, AU) == pytest.approx(flat, abs=1e-6)


def seen_from(x, y):
    """Illumination at a place in the plane of a Sun 1 AU along +x."""
    distance = math.hypot(AU - x, y)
    return conical_illumination((x, y, 0.0), ((AU - x) / distance, -y / distance, 0.0), distance)


@pytest.mark.parametrize("depth", [1e6, 2.3e6, 2e7, 3e8])
def test_shadow_edges_are_the_common_tangents_of_sun_and_earth(depth):
    """Umbra inside the outer tangents, full Sun outside the inner ones, 200 m on either side of the edge."""
    outer = math.asin((SOLAR_RADIUS - EARTH_RADIUS) / AU)
    umbra = EARTH_RADIUS / math.cos(outer) - depth * math.tan(outer)
    assert seen_from(-depth, umbra - 200.0) == 0.0 < seen_from(-depth, umbra + 200.0) < 0.1
    inner = math.asin((SOLAR_RADIUS + EARTH_RADIUS) / AU)
    penumbra = EARTH_RADIUS / math.cos(inner) + depth * math.tan(inner)
    assert 0.9 < seen_from(-depth, penumbra - 200.0) < 1.0 == seen_from(-depth, penumbra + 200.0)


def test_beyond_the_tip_of_the_umbra_a_ring_of_sun_remains():
    depth = 2e9
    fraction = conical_illumination((-depth, 0.0, 0.0), (1.0, 0.0, 0.0), AU + depth)
    expected = 1.0 - (math.asin(EARTH_RADIUS / depth) / math.asin(SOLAR_RADIUS / (AU + depth))) ** 2
    assert fraction == pytest.approx(expected, abs=1e-9)


def test_cylinder_is_the_far_sun_limit():
    s = (1.0, 0.0, 0.0)
    for angle in np.radians(np.arange(0.0, 360.0, 0.37)):
        r = (7e6 * math.cos(angle), 7e6 * math.sin(angle), 0.0)
        assert cylindrical_illumination(r, s) == conical_illumination(r, s, 1e20)


def test_positions_inside_the_earth_give_no_nan():
    assert conical_illumination((-6.0e6, 0.0, 0.0), (1.0, 0.0, 0.0), AU) == 0.0
    assert math.isfinite(conical_illumination((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), AU))


def sunlit_minutes(orbit, epoch_ns, conical):
    ephemeris = build_ephemeris(orbit, epoch_ns, field=False, conical_shadow=conical)
    t = np.arange(0.0, orbit_period(orbit), 0.5)
    return sum(at(ephemeris, float(k)).illumination for k in t) * 0.5 / 60.0


@pytest.mark.parametrize("conical", [True, False])
def test_sunlit_time_of_the_papers_orbit(conical):
    """O'Keefe & Schaub 2013: approximately 56.5 minutes of Sun an orbit."""
    orbit = keplerian_orbit(6_778_137.0, 0.0, 45.0, 60.0)
    assert sunlit_minutes(orbit, 1_370_044_800 * 10**9, conical) == pytest.approx(56.5, abs=0.5)


def test_sunlit_time_against_the_closed_form_of_a_circular_orbit():
    """Eclipsed fraction of a cylinder: arccos(sqrt(1 - (R/r)^2) / cos(beta)) / pi."""
    orbit = keplerian_orbit(6_853_184.0, 0.0, 97.297, 243.6)
    ephemeris = build_ephemeris(orbit, 834_019_200 * 10**9, field=False)
    start = at(ephemeris, 0.0)
    normal = np.cross(start.r_n, start.v_n)
    beta = math.asin(normal @ start.sun_n / np.linalg.norm(normal))
    assert math.degrees(beta) == pytest.approx(7.0, abs=0.3)
    horizon = math.sqrt(1.0 - (EARTH_RADIUS / 6_853_184.0) ** 2)
    expected = orbit_period(orbit) / 60.0 * (1.0 - math.acos(horizon / math.cos(beta)) / math.pi)
    assert expected == pytest.approx(58.4, abs=0.1)
    assert sunlit_minutes(orbit, 834_019_200 * 10**9, False) == pytest.approx(expected, abs=0.03)
