# SPDX-License-Identifier: Apache-2.0
"""What a mission may ask of the Earth's reflectivity, and what it is told when it asks wrongly."""

import numpy as np
import pytest

from css_common.mission_section import MISSION
from css_common.random_streams import random_key
from css_common.schema import default_values
from css_environment.reflectivity import HIGHEST, LOWEST
from css_sim import earth_reflectivity

EPOCH_NS = 1_370_044_800_000_000_000
KEY = random_key(4, 2)


def values(**changes):
    given = {f"albedo__{k}": v for k, v in changes.items()}
    return default_values(MISSION + earth_reflectivity.PARAMETERS, mission__duration=5550.0, **given)


def reflectivity(key=KEY, **changes):
    v = values(**changes)
    return earth_reflectivity.case_reflectivity(v, earth_reflectivity.source(v, EPOCH_NS), key)


def test_models():
    assert reflectivity().shape == (36, 1)
    assert reflectivity(reflectivity="knocke").shape == (36, 1)
    assert reflectivity(reflectivity="constant", constant=0.4).tolist() == [[0.4]]


def test_draws_are_of_the_case():
    mean = reflectivity()
    common = reflectivity(draw="common")
    grid = earth_reflectivity.source(values(draw="common"), EPOCH_NS)
    inside = (common > LOWEST) & (common < HIGHEST)
    deviations = ((common - mean) / grid.std)[inside]
    assert inside.sum() > 20 and np.ptp(deviations) < 1e-9
    cells = reflectivity(draw="per_cell")
    assert cells.shape == (36, 72)
    assert np.array_equal(cells, reflectivity(draw="per_cell"))
    assert not np.array_equal(cells, reflectivity(random_key(4, 3), draw="per_cell"))


def test_factor_and_limit():
    # Benton doubles the albedo and clips it at 0.8
    np.testing.assert_allclose(reflectivity(factor=2.0, limit=0.8), np.minimum(2 * reflectivity(), 0.8))


def test_grid_of_a_file(tmp_path):
    file = tmp_path / "grid.csv"
    file.write_text("0.1,0.2\n0.3,0.4\n")
    assert reflectivity(reflectivity="file", mean_file=str(file)).tolist() == [[0.1, 0.2], [0.3, 0.4]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"reflectivity": "file"}, "mean_file: missing"),
        ({"reflectivity": "file", "mean_file": "/nowhere/grid.csv"}, "/nowhere/grid.csv"),
        ({"reflectivity": "knocke", "draw": "common"}, "no standard deviations"),
        ({"drift_m_s": 10.0}, "albedo.drift_m_s: given with albedo.draw mean"),
        ({"drift_spread_m_s": 10.0, "draw": "common"}, "albedo.drift_spread_m_s: given with albedo.draw common"),
        ({"renewal_h": 3.0}, "albedo.renewal_h: given with albedo.draw mean"),
        ({"renewal_h": 0.001, "draw": "per_cell"}, "albedo.renewal_h: 0.001 given, expected at least 0.00308"),
    ],
)
def test_conflicts(changes, message):
    (found,) = earth_reflectivity.conflicts(values(**changes))
    assert message in found


def test_no_conflict_by_default():
    assert list(earth_reflectivity.conflicts(values())) == []
