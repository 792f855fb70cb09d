# SPDX-License-Identifier: Apache-2.0
"""Orbits over more time than one set of elements holds: drag, holes, manoeuvres, and what is no orbit."""

import numpy as np
import pytest

from css_common.mission import MissionError, mission_from_text
from css_common.mission_file import dump_sections
from css_environment.mission_environment import mission_orbit
from css_environment.orbit import ArcsOrbit, keplerian_orbit, orbit_states
from css_telemetry.orbit_arcs import FAR_S, LONGEST_S, fit_arcs
from css_telemetry.places import Place

EPOCH_NS = 1_709_294_400 * 10**9
DAY_S = 86_400.0


def lowered(time, daily_m, manoeuvre_s=np.inf):
    """Positions (T, 3) of an orbit that comes down by so many metres a day, and is raised by 5 km at an instant.

    A circle over the poles, whose node stands still; what J2 does within a revolution, 10 km at most, is not in it.
    """
    days = time / DAY_S
    axis = 6_878_137.0 - daily_m * days + 5000.0 * (time > manoeuvre_s)
    rate = np.sqrt(3.986004418e14 / axis**3)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])
    reference, _ = orbit_states(keplerian_orbit(6_878_137.0, 0.0, 90.0, 30.0), EPOCH_NS, np.array([0.0, 1400.0]))
    p = reference[0] / np.linalg.norm(reference[0])
    w = np.cross(reference[0], reference[1])
    q = np.cross(w / np.linalg.norm(w), p)
    return axis[:, None] * (np.cos(angle)[:, None] * p + np.sin(angle)[:, None] * q)


def place_of(r_n):
    return Place(r_n, np.full_like(r_n, np.nan))


def stamps_of(time):
    return EPOCH_NS + np.round(time * 1e9).astype(np.int64)


def orbit_of(found):
    """The orbit that a mission with these elements has."""
    first, *later = found.arcs
    entries = {f"orbit.{key}": value for key, value in first.elements._asdict().items()}
    entries |= {"orbit.source": "elements", "orbit.model": "j2_integrated"}
    entries["orbit.later_elements"] = [float(x) for arc in later for x in (arc.start_s, *arc.elements)]
    entries |= {"mission.epoch": "2024-03-01T12:00:00Z", "mission.duration": 1.0}
    return mission_orbit(mission_from_text(dump_sections({"/**": entries}), "arcs").values)


def test_weeks_with_drag_have_several_sets_of_elements_and_every_place_is_near():
    time = np.arange(0.0, 8.0 * DAY_S, 900.0)
    true = lowered(time, 150.0)
    found = fit_arcs(place_of(true), stamps_of(time))
    assert len(found.arcs) >= 3 and not found.lost_s
    assert found.arcs[0].start_s == 0.0
    assert all(arc.end_s - arc.start_s <= 1.01 * LONGEST_S for arc in found.arcs)
    orbit = orbit_of(found)
    assert isinstance(orbit, ArcsOrbit)
    r_n, v_n = orbit_states(orbit, EPOCH_NS, time)
    assert np.linalg.norm(r_n - true, axis=1).max() < 21e3
    assert np.all(np.abs(np.linalg.norm(v_n, axis=1) - 7613.0) < 30.0)


def test_a_manoeuvre_ends_a_set_and_the_way_goes_on():
    time = np.arange(0.0, 3.0 * DAY_S, 300.0)
    true = lowered(time, 0.0, manoeuvre_s=1.3 * DAY_S)
    found = fit_arcs(place_of(true), stamps_of(time))
    r_n, _ = orbit_states(orbit_of(found), EPOCH_NS, time)
    away = np.linalg.norm(r_n - true, axis=1)
    assert np.mean(away < 21e3) > 0.97
    lost = sum(end - begin for begin, end in found.lost_s)
    assert lost < 0.1 * DAY_S


def test_positions_that_are_unknown_for_weeks_leave_a_hole_between_two_sets():
    time = np.concatenate([np.arange(0.0, DAY_S, 600.0), np.arange(12.0 * DAY_S, 13.0 * DAY_S, 600.0)])
    true = lowered(time, 0.0)
    found = fit_arcs(place_of(true), stamps_of(time))
    assert len(found.arcs) == 2
    assert found.arcs[1].start_s - found.arcs[0].end_s > FAR_S


def test_what_is_no_orbit_over_months_is_refused_soon():
    time = np.arange(0.0, 60.0 * DAY_S, 1200.0)
    noise = np.random.default_rng(3).normal(size=(len(time), 3))
    positions = 7e6 * noise / np.linalg.norm(noise, axis=1, keepdims=True)
    with pytest.raises(ValueError, match=r"km from the nearest orbit|no closed orbit|comes down"):
        fit_arcs(place_of(positions), stamps_of(time))


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([3600.0, 500e3, 0.0, 97.0, 0.0, 0.0, 0.0, 1800.0, 500e3, 0.0, 97.0, 0.0, 0.0, 0.0], "row 1: holds from 1800"),
        ([3600.0, 500e3, 0.95, 97.0, 0.0, 0.0, 0.0], "row 0: expected an eccentricity"),
        ([3600.0, 50e3, 0.0, 97.0, 0.0, 0.0, 0.0], "row 0: altitude 50000"),
    ],
)
def test_rows_that_are_no_elements_are_refused(rows, told):
    entries = {"orbit.source": "elements", "orbit.model": "j2_integrated", "orbit.altitude": 500e3}
    entries |= {"orbit.later_elements": rows, "mission.epoch": "2024-03-01T12:00:00Z", "mission.duration": 1.0}
    with pytest.raises(MissionError, match=told):
        _ = mission_from_text(dump_sections({"/**": entries}), "arcs").values
