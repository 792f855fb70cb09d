# SPDX-License-Identifier: Apache-2.0
"""Layouts that are judged by flights: the mission's own is among them, and what is taken flies no worse."""

import json

import numpy as np
import pytest

from css_common.command import USAGE
from css_common.mission import load_mission
from css_design.commands import layout
from css_design.errors import DesignError
from css_design.layout.flown import between, fly_layouts
from css_design.layout.readings import Cells

SHORT = ["mission.duration=300", "orbit.true_anomaly_deg=60"]


def pyramid(tilt_deg, turned_deg=0.0):
    """Four cells on each side, as far from the z axis."""
    tilt, azimuth = np.radians(tilt_deg), np.radians(turned_deg + 90.0 * np.arange(4))
    up = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(4, np.cos(tilt))], axis=1)
    return Cells(np.vstack([up, up * [1.0, 1.0, -1.0]]), np.full(8, 120.0))


def test_what_lies_between_two_layouts_pairs_nearest_cells():
    first, second = pyramid(40.0), pyramid(60.0)
    mixed = second.chosen([3, 0, 7, 6, 1, 2, 5, 4])
    (_, half, _) = between(first, mixed)
    np.testing.assert_allclose(half.normals_b, pyramid(50.0).normals_b, atol=1e-12)
    assert between(first, second.chosen([0, 1, 2])) == []
    assert between(first, Cells(second.normals_b, np.full(8, 90.0))) == []


def test_flights_rank_layouts_under_the_same_draws():
    mission = load_mission("okeefe_2013", SHORT)
    own = Cells(np.asarray(mission.values.cells.normals), np.full(8, 120.0))
    # cells along the axis leave the sides unseen
    found = fly_layouts(mission, [("narrow", pyramid(2.0)), ("own", own), ("again", own)], lambda _: np.zeros(0), 3)
    assert [one.name for one in found] == ["own", "again", "narrow"]
    assert (found[0].mean, found[0].bound) == (found[1].mean, found[1].bound)
    assert found[0].rank <= found[1].rank <= found[2].rank
    assert found[0].acquired == found[0].cases == 3
    with pytest.raises(DesignError, match="no layout to fly"):
        fly_layouts(mission, [], lambda _: np.zeros(0), 3)


def test_flights_take_the_place_of_what_the_search_took(tmp_path, capsys):
    changes = [word for override in SHORT for word in ("--set", override)]
    small = ["okeefe_2013", *changes, "--faces", "+z", "-z", "--cells", "2", "--flights", "2"]
    assert layout.main([*small, "--out", str(tmp_path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    flown = result["flown"]["2"]
    assert [one["cases"] for one in flown] == [2] * len(flown)
    np.testing.assert_allclose(result["front"][0]["normals"], flown[0]["normals"])


def test_so_few_flights_tell_nothing(tmp_path, capsys):
    assert layout.main(["okeefe_2013", "--flights", "1", "--out", str(tmp_path)]) == USAGE
    assert "--flights: 1 given, expected 2 to 10000" in capsys.readouterr().err
