# SPDX-License-Identifier: Apache-2.0
"""Attitude kinematics against Basilisk's RigidBodyKinematics on the same inputs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from css_common import attitude
from css_common.vectors import norm

VECTORS = json.loads((Path(__file__).parent / "data" / "mrp_kinematics.json").read_text(encoding="utf-8"))
# Both sides round a dozen operations on numbers of order one.
EXACT: dict[str, Any] = {"rtol": 0.0, "atol": 5e-15}


@pytest.fixture(params=VECTORS["cases"], ids=range(len(VECTORS["cases"])))
def case(request):
    """One pair of attitudes and a rate, as tuples, with Basilisk's results."""
    return {key: tuple(map(tuple, v)) if isinstance(v[0], list) else tuple(v) for key, v in request.param.items()}


def test_the_vectors_reach_both_mrp_sets_and_both_signs_of_the_switch():
    sizes = [np.linalg.norm(case["a"]) for case in VECTORS["cases"]]
    assert min(sizes) < 1.0 < max(sizes)


def test_direction_cosine_matrix(case):
    assert_allclose(attitude.mrp_to_dcm(case["a"]), case["MRP2C_a"], **EXACT)


def test_mrp_of_a_direction_cosine_matrix(case):
    assert_allclose(attitude.dcm_to_mrp(case["MRP2C_a"]), case["C2MRP_of_MRP2C_a"], **EXACT)


def test_shadow_switch(case):
    assert_allclose(attitude.mrp_shadow(case["a"]), case["MRPswitch_a"], **EXACT)


def test_sum(case):
    assert_allclose(attitude.mrp_add(case["a"], case["b"]), case["addMRP"], **EXACT)


def test_difference(case):
    assert_allclose(attitude.mrp_subtract(case["a"], case["b"]), case["subMRP"], **EXACT)


def test_rate(case):
    assert_allclose(attitude.mrp_rate(case["a"], case["omega"]), case["dMRP"], **EXACT)


def test_rate_is_a_quarter_of_the_b_matrix(case):
    columns = [attitude.mrp_rate(case["a"], axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    assert_allclose(4.0 * np.array(columns).T, case["BmatMRP_a"], **EXACT)


def test_quaternion(case):
    # Basilisk puts the scalar first
    w, x, y, z = case["MRP2EP_a"]
    assert_allclose(attitude.mrp_to_quaternion(case["a"]), (x, y, z, w), **EXACT)


def test_rotation_vector(case):
    assert_allclose(attitude.rotation_vector_to_dcm(case["omega"]), case["PRV2C_w"], **EXACT)
    assert_allclose(attitude.rotation_vector_to_dcm(case["MRP2PRV_a"]), case["MRP2C_a"], rtol=0.0, atol=2e-14)


def test_every_result_stays_inside_the_unit_ball(case):
    for sigma in (attitude.mrp_add(case["a"], case["b"]), attitude.mrp_subtract(case["a"], case["b"])):
        assert norm(sigma) <= 1.0
