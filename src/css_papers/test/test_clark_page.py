# SPDX-License-Identifier: Apache-2.0
"""The page of Benton from flights and tables of which every number is known, and from a few short real flights."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib import image
from page_reader import read
from presence import present
from synthetic_study import case_table, percentile_table

from css_common.attitude import mrp_to_dcm
from css_common.mission import load_mission
from css_monte_carlo.study import Study
from css_papers.clark import cases, paper
from css_papers.clark.assumptions import AS_FLOWN, changes, fly_controls
from css_papers.clark.cases import averages, configuration, fly_cases_of
from css_papers.clark.cell import CLOSEST_DEG, Cell
from css_papers.clark.flights import DOUBLED, FLAT, PYRAMID, Flight, acquisition_min, fly, handover_min
from css_papers.clark.numbers import FLAT_ANGLE, angle_rows
from css_papers.clark.panel_power import REFLECTANCE, power_curve, reflector_power
from css_papers.clark.seasons import DATES, DECEMBER, JUNE, SEPTEMBER, Campaign, Point, profile, profile_rows
from css_papers.clark.staring import Stare, facing, fly_stares, stare_rows, stare_starts
from css_papers.commands.reproduce import main
from css_papers.papers import Request

UNIT = st.floats(-1.0, 1.0)
VECTOR = st.tuples(UNIT, UNIT, UNIT).filter(lambda v: math.hypot(*v) > 0.1)
ORBIT_S, SUNRISE_S, SUNSET_S = 5646.0, 700.0, 4200.0


@pytest.fixture(autouse=True)
def without_display(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def made_flight(panel=(60.0, 5.0), settles_s=360.0):
    """Two orbits; in each pass the panel is off by the first angle up to a time from sunrise, then by the second."""
    time_s = np.arange(0.0, 2.0 * ORBIT_S, 2.0)
    phase = time_s % ORBIT_S
    sunlit = (phase >= SUNRISE_S) & (phase <= SUNSET_S)
    settled = phase - SUNRISE_S >= settles_s
    angle = np.where(settled, panel[1], panel[0])
    passes = [(n * ORBIT_S + SUNRISE_S, n * ORBIT_S + SUNSET_S) for n in range(2)]
    error = np.where(sunlit, 3.0, np.nan)
    return Flight(time_s, sunlit, angle, np.where(sunlit, angle, 90.0), error, sunlit & settled, passes)


def test_acquisition_lasts_until_the_panel_stays_near_the_sun():
    flight = made_flight()
    assert acquisition_min(flight) == pytest.approx([6.0, 6.0], abs=0.04)
    assert handover_min(flight) == pytest.approx([6.0, 6.0], abs=0.04)
    assert acquisition_min(made_flight((8.0, 5.0))) == [0.0, 0.0]
    assert acquisition_min(made_flight((60.0, 11.0))) == [math.inf, math.inf]
    assert flight.mean_error == 3.0
    share = 360.0 / (SUNSET_S - SUNRISE_S)
    assert flight.mean_panel == pytest.approx(5.0 + 55.0 * share, abs=0.05)


@pytest.mark.parametrize(
    ("flat", "pyramid", "doubled", "missed"),
    [
        (16.3, 8.54, 8.55, set()),
        (16.3, 8.54, 9.2, {"pyramid, doubled to nominal"}),
        (16.3, 10.2, 10.1, {"panel to Sun, pyramid", "panel to Sun, pyramid, doubled", "pyramid over flat"}),
        (12.0, 8.54, 8.55, {"pyramid over flat"}),
    ],
)
def test_the_papers_conclusions_are_judged(flat, pyramid, doubled, missed):
    rows = angle_rows(5.03, flat, pyramid, doubled, notes={FLAT_ANGLE: "why"})
    assert {line.quantity for line in rows if not line.ok} == missed
    assert [line.quantity for line in rows if line.note] == [FLAT_ANGLE]


def test_a_count_covers_the_angle_of_the_closed_form():
    cell = Cell(load_mission(FLAT))
    count = 1.0 / 4096.0
    assert cell.uncertainty_deg(0.0) == pytest.approx(math.degrees(math.acos(1.0 - count)), abs=1e-4)
    for degrees in (26.7, 30.0, 63.0):
        # a level lies around the angle, not below it as the paper has it: the slope at the angle is close enough
        expected = math.degrees(count / math.sin(math.radians(degrees)))
        assert cell.uncertainty_deg(degrees) == pytest.approx(expected, rel=2e-3)
    response = cell.response()
    dark = response.angle_deg > 83.0
    assert np.all(response.output[dark] == 0.0) and np.all(response.output[~dark] > math.sin(math.radians(6.99)))


def test_the_worst_angle_of_the_pyramid_is_that_of_its_collar():
    mission = load_mission(PYRAMID)
    collar = mission.node("css_array").values.collar
    for number in collar.cells:
        off_axis = math.degrees(math.acos(float(mission.values.cells.normals[number] @ collar.axis)))
        assert off_axis - collar.full_deg == pytest.approx(CLOSEST_DEG, abs=0.05)


def test_reflectors_add_what_they_reflect_and_lose_it_sooner():
    assert reflector_power(0.0) == pytest.approx(1.0 + REFLECTANCE, abs=2e-3)
    angles = np.radians(np.linspace(0.0, 90.0, 46))
    power = power_curve(angles)
    assert power[0] == 1.0 and np.all(np.diff(power) <= 1e-3)
    assert np.all(power[1:] < np.cos(angles[1:]) + 1e-12)
    # the sunward mirror leans 30 deg out: below that the panel has all of its own light, and each mirror at most its
    # share of the opening
    for degrees in (5.0, 15.0, 29.0):
        direct = math.cos(math.radians(degrees))
        assert direct <= reflector_power(math.radians(degrees)) <= direct * (1.0 + REFLECTANCE)
    assert reflector_power(math.radians(-20.0)) == pytest.approx(reflector_power(math.radians(20.0)), abs=2e-3)
    assert reflector_power(math.pi) == 0.0


@settings(max_examples=50)
@given(VECTOR, VECTOR, st.floats(0.0, 2.0 * math.pi))
def test_an_attitude_that_faces_a_direction_does(normal, direction, roll):
    n, d = (np.array(v) / math.hypot(*v) for v in (normal, direction))
    sigma = facing(n, d, roll)
    dcm_bn = np.array(mrp_to_dcm(tuple(sigma.tolist())))
    np.testing.assert_allclose(dcm_bn @ d, n, atol=1e-9)


def test_dates_keep_the_local_time():
    start = load_mission(FLAT).values.orbit.raan_deg
    assert f"orbit.raan_deg={start:.3f}" in Point(JUNE, 1.0).overrides
    (raan,) = (float(text.split("=")[1]) for text in Point(DECEMBER, 1.0).overrides if "raan" in text)
    # 198 days of the mean Sun
    assert (raan - start) % 360.0 == pytest.approx(198 * 0.985647, abs=2e-3)


def hump(time_s, share):
    """Error [deg] with a peak at a share of each pass; NaN in the shadow."""
    phase = (time_s % ORBIT_S - SUNRISE_S) / (SUNSET_S - SUNRISE_S)
    error = 2.0 + 10.0 * np.exp(-(((phase - share) / 0.1) ** 2))
    return np.where((phase >= 0.0) & (phase <= 1.0), error, np.nan)


def seasonal(configuration, quantity, time_s):
    overrides = " ".join(configuration.overrides)
    if quantity != "heading_error_deg":
        return np.ones(len(time_s))
    if JUNE in overrides or DECEMBER in overrides:
        return hump(time_s, 0.25 if JUNE in overrides else 0.75)
    return np.maximum(hump(time_s, 0.25), hump(time_s, 0.75))


def made_study(mission, configurations, count, folder, **_):
    """In the place of flights: the pyramid has 5 deg, flat cells 11, K = 0.148 a half of that."""
    time_s = np.arange(0.0, 4.0 * ORBIT_S, 60.0)
    angles = {}
    for c in configurations:
        panel = (11.0 if c.estimator == "flat" else 5.0) * (0.5 if "gains.k=0.148" in " ".join(c.overrides) else 1.0)
        angles[c] = {"pointing_error_sunlit_deg": [panel] * count, "heading_error_sunlit_deg": [0.4 * panel] * count}
    return Study(
        folder, {}, case_table(configurations, count, angles), percentile_table(configurations, time_s, seasonal)
    )


def test_peaks_are_found_where_they_are():
    configurations = [Point(date, 1.0).flown(FLAT) for date in DATES]
    time_s = np.arange(0.0, 4.0 * ORBIT_S, 60.0)
    campaign = Campaign((), 1, {}, percentile_table(configurations, time_s, seasonal))
    found = {date: profile(campaign, date) for date in (JUNE, SEPTEMBER, DECEMBER)}
    assert found[JUNE].peak_share == pytest.approx(0.25, abs=0.03)
    assert found[DECEMBER].peak_share == pytest.approx(0.75, abs=0.03)
    first, second = found[SEPTEMBER].halves
    assert 10.0 < first < 12.0 and second == pytest.approx(first, abs=0.5)
    assert all(line.ok for line in profile_rows(found)) and len(profile_rows(found)) == 3
    swapped = profile_rows({JUNE: found[DECEMBER], SEPTEMBER: found[JUNE]})
    assert not any(line.ok for line in swapped)


def test_a_flight_without_a_whole_pass_has_no_profile():
    campaign = Campaign((), 1, {}, percentile_table([Point(JUNE, 1.0).flown(FLAT)], np.arange(0.0, 600.0, 60.0)))
    with pytest.raises(ValueError, match="no whole pass"):
        profile(campaign, JUNE)


def test_the_note_says_what_flat_cells_hang_on(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "run_study", made_study)
    controls = fly_controls(2, Request(tmp_path, 2, False))
    assert list(controls.flat) == list(changes()) and controls.flat[AS_FLOWN].panel == pytest.approx(11.0)
    note = paper.flat_note(controls)
    # the only other point of pyramid and flat cells is half of both, so that 8.54 is past the end
    assert note.startswith("11.0 deg in the controls: 5.0 of it are acquisition, 6.0 ")
    assert "gains with the paper's 8.54 for the pyramid would have 11.0" in note


def test_a_stare_that_is_believed_or_never_ends_misses():
    good = Stare(120.0, 0.5, 140.0, 60.0, 2.0, 150.0)
    assert all(line.ok for line in stare_rows([good, good]))
    believed = stare_rows([good, good._replace(denied_s=0.0, adopted_error_deg=120.0, acquired_s=math.inf)])
    assert not any(line.ok for line in believed)
    assert all(0.0 <= present(line.here) <= 120.0 for line in believed)


def test_the_page_has_every_figure_and_number(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cases, "run_study", made_study)
    angles = {FLAT: (80.0, 15.0), PYRAMID: (40.0, 4.0)}
    monkeypatch.setattr(paper, "fly", lambda name, overrides=(): made_flight(angles[name]))
    monkeypatch.setattr(paper, "fly_stares", lambda **_: [Stare(120.0, 0.5, 140.0, 60.0, 2.0, 150.0)])
    assert main(["clark", "--cases", "30", "--out", str(tmp_path), "--json"]) == 0
    out = capsys.readouterr().out
    result = json.loads(out.splitlines()[-1])
    assert result["paper"] == "clark"
    by_name = {line["quantity"]: line for line in result["rows"]}
    assert len(by_name) == len(result["rows"])
    for line in result["rows"]:
        assert list(line) == ["quantity", "unit", "paper", "here", "must", "ok"] and isinstance(line["ok"], bool)
    assert {5.03, 16.3, 8.54, 8.55, 6.0, 1.27, 0.03, 0.016} <= {line["paper"] for line in result["rows"]}
    assert by_name[FLAT_ANGLE]["here"] == pytest.approx(11.0) and by_name["panel to Sun, pyramid"]["ok"]
    assert by_name["acquisition, to 10 deg"]["here"] == pytest.approx(6.0, abs=0.04)
    assert all(line["ok"] for line in result["rows"])
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    for figure in (1, 3, 5, 7, 8):
        assert f"Figure {figure}." in page
    found = read(page)
    assert found.plots and [link for link in found.outside if link.endswith(".png")] == []
    files = list(tmp_path.glob("*.png"))
    assert len(files) == 8
    for file in files:
        pixels = image.imread(file)
        assert min(pixels.shape[:2]) > 300 and pixels[..., :3].std() > 0.02
    for words in (
        "albedo from nadir",
        "inertia x 2",
        "21 December, albedo x 0.5",
        "K 0.148",
        "with reflectors",
        ", 3 cases each;",
    ):
        assert words in page
    # no column is cut off where a console has no width
    assert "…" not in out


def test_short_real_flights(tmp_path):
    """From just before a sunrise on the dark side of the terminator to a Sun that both ways to sense have found."""
    sunrise = ("orbit.true_anomaly_deg=40", "mission.duration=1500")
    flight = fly(PYRAMID, (*DOUBLED, *sunrise))
    assert not flight.sunlit[0] and flight.sunlit[-1]
    assert flight.panel_sensed[0] == pytest.approx(90.0) and np.isnan(flight.error[0])
    assert flight.on_pyramid[-1] and flight.panel_true[-1] < 10.0 and flight.error[-1] < 5.0
    # the same case in the compiled loop
    table = fly_cases_of(PYRAMID, [DOUBLED], 1, "short", Request(tmp_path, 1, True), sunrise).cases
    average = averages(table, configuration(PYRAMID, DOUBLED))
    assert average.panel == pytest.approx(flight.mean_panel, abs=1e-6)
    assert average.error == pytest.approx(flight.mean_error, abs=1e-6)


def test_a_real_stare_is_denied_and_turned_away_from():
    mission = load_mission(PYRAMID, list(DOUBLED))
    places = stare_starts(mission)
    assert len(places) >= 3 and all(np.linalg.norm(light) <= 0.8 for _, light, _ in places)
    (stare,) = fly_stares(600.0, most=1)
    assert stare.denied_s > 1.0 and stare.adopted_error_deg < 10.0 and stare.acquired_s < 600.0
