# SPDX-License-Identifier: Apache-2.0
"""Elements through positions: those that made them, for every shape of orbit, and none where there is none."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from css_common.epochs import format_utc
from css_environment.j2_integration import STEP_S, J2Track
from css_environment.orbit import IntegratedOrbit, keplerian_orbit, orbit_states
from css_recording.errors import BagError
from css_telemetry import import_table, orbit_fit
from css_telemetry.orbit_fit import Elements, elements_of, fit_orbit
from css_telemetry.places import Place

EPOCH_NS = 1_709_294_400 * 10**9
EARTH_RADIUS = 6_378_137.0


def orbit_of(e: Elements) -> IntegratedOrbit:
    return IntegratedOrbit(
        keplerian_orbit(
            EARTH_RADIUS + e.altitude,
            e.eccentricity,
            e.inclination_deg,
            e.raan_deg,
            e.argument_of_perigee_deg,
            e.true_anomaly_deg,
        )
    )


ANGLE = st.floats(-179.0, 179.0)


@settings(max_examples=100, deadline=None)
@given(st.floats(200e3, 36_000e3), st.floats(0.0, 0.7), st.floats(0.0, 180.0), ANGLE, ANGLE, ANGLE)
@example(500e3, 0.0, 0.0, 0.0, 0.0, 0.0)
@example(500e3, 0.0, 98.0, 10.0, 0.0, 77.0)
@example(500e3, 0.01, 180.0, 10.0, 20.0, 77.0)
def test_elements_have_the_position_and_velocity_that_they_are_of(
    altitude, eccentricity, inclination, raan, arg, place
):
    perigee_limit = (altitude - 150e3) / (EARTH_RADIUS + altitude)
    given_elements = Elements(altitude, min(eccentricity, perigee_limit), inclination, raan, arg, place)
    r_n, v_n = orbit_states(orbit_of(given_elements), EPOCH_NS, 0.0)
    again_r, again_v = orbit_states(orbit_of(elements_of(r_n[0], v_n[0])), EPOCH_NS, 0.0)
    np.testing.assert_allclose(again_r, r_n, atol=1.0)
    np.testing.assert_allclose(again_v, v_n, atol=1e-3)


@pytest.mark.parametrize(("days", "step_s"), [(0.01, 10.0), (1.0, 120.0)])
def test_positions_with_noise_give_the_orbit_back(days, step_s):
    orbit = orbit_of(Elements(550e3, 0.002, 97.5, 30.0, 80.0, -20.0))
    time = np.arange(0.0, days * 86_400.0, step_s)
    true, _ = orbit_states(orbit, EPOCH_NS, time)
    rng = np.random.default_rng(7)
    r_n = true + rng.normal(scale=10.0, size=true.shape)
    r_n[::7] = np.nan
    stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    fit = fit_orbit(Place(r_n, np.full_like(r_n, np.nan)), stamps)
    found, _ = orbit_states(orbit_of(fit.elements), EPOCH_NS, time)
    # what is known of the way is better than a single position; three components of 10 m each
    assert np.linalg.norm(found - true, axis=1).max() < 30.0
    assert fit.rms_m == pytest.approx(10.0 * 3**0.5, rel=0.25)


@pytest.mark.parametrize(
    ("positions", "words"),
    [
        (np.full((10, 3), np.nan), "0 positions are known, expected at least 3"),
        (np.tile([7e6, 0.0, 0.0], (600, 1)), "km from the nearest orbit|no closed orbit|comes down"),
    ],
)
def test_what_is_no_orbit_is_told(positions, words):
    stamps = EPOCH_NS + np.arange(len(positions)) * 10 * 10**9
    with pytest.raises(ValueError, match=words):
        fit_orbit(Place(positions, np.full_like(positions, np.nan)), stamps)


TLE = (
    "1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927",
    "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537",
)


@pytest.mark.parametrize(("begin_s", "words"), [(1_221_912_000, None), (1_400_000_000, "aiding.position.tle")])
def test_an_element_set_is_the_orbit_of_its_days_and_of_no_others(tmp_path, begin_s, words):
    (tmp_path / "t.csv").write_text(f"time,c\n{begin_s},0.5\n{begin_s + 1},0.5\n")
    lines = ", ".join(f"'{line}'" for line in TLE)
    (tmp_path / "d.yaml").write_text(f"cells: {{c: [1, 0, 0]}}\naiding: {{position: {{tle: [{lines}]}}}}\n")
    if words is None:
        report = import_table(tmp_path / "t.csv", tmp_path / "d.yaml", tmp_path / "bag")
        assert report.orbit == {"source": "tle", "tle_line1": TLE[0], "tle_line2": TLE[1]}
        assert format_utc(report.first_ns) == "2008-09-20T12:00:00Z"
        return
    with pytest.raises(BagError, match=words):
        import_table(tmp_path / "t.csv", tmp_path / "d.yaml", tmp_path / "bag")


def test_a_boot_that_nobody_dated_has_no_orbit_and_no_ephemeris(tmp_path):
    (tmp_path / "t.csv").write_text("t,c,x,y,z,w\n" + "".join(f"{k},0.5,0,0,0,1\n" for k in range(5)))
    lines = ", ".join(f"'{line}'" for line in TLE)
    text = f"cells: {{c: [1, 0, 0]}}\ntime: {{column: t, scale: boot}}\naiding: {{position: {{tle: [{lines}]}}}}\n"
    (tmp_path / "d.yaml").write_text(text)
    report = import_table(tmp_path / "t.csv", tmp_path / "d.yaml", tmp_path / "bag")
    assert report.orbit == {} and "the instant of the boot is not known" in report.orbit_notes[0]
    attitude = "truth: {attitude: {columns: [x, y, z, w], order: xyzw, direction: inertial_to_body}}\n"
    (tmp_path / "d.yaml").write_text(text + attitude)
    with pytest.raises(BagError, match=r"expected time.epoch, truth.sun or truth.sun_inertial"):
        import_table(tmp_path / "t.csv", tmp_path / "d.yaml", tmp_path / "bag2")


def test_a_week_is_integrated_a_hundred_times_at_most(monkeypatch):
    """Months are some sixty weeks: each was followed five hundred times, in steps as long as for the result."""
    steps_s = []

    class Counted(J2Track):
        def __init__(self, r_n, v_n, step_s=STEP_S):
            super().__init__(r_n, v_n, step_s)
            steps_s.append(step_s)

    monkeypatch.setattr(orbit_fit, "J2Track", Counted)
    time = np.arange(0.0, 7.0 * 86_400.0, 600.0)
    true, _ = orbit_states(orbit_of(Elements(550e3, 0.002, 97.5, 30.0, 80.0, -20.0)), EPOCH_NS, time)
    fit = fit_orbit(Place(true, np.full_like(true, np.nan)), EPOCH_NS + np.round(time * 1e9).astype(np.int64))
    assert fit.worst_m < 20.0
    assert len(steps_s) <= 150
    assert sum(step_s < 30.0 for step_s in steps_s) <= 40
