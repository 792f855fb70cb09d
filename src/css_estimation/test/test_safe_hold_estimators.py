# SPDX-License-Identifier: Apache-2.0
"""Benton's estimators: the choice of flat cells, its "wrong side" error, and when the pyramid is believed."""

import math

import numpy as np
import pytest
from clark_light import FLAT, FLAT_NORMALS, NORMALS, PANEL, PYRAMID, SHARED, SWITCH, build, off_panel, outputs
from hypothesis import given, settings
from hypothesis import strategies as st

from css_common.schema import default_values
from css_estimation.sun.flat_faces import flat_heading
from css_estimation.sun.pyramid_switch import pyramid_heading
from css_estimation.sun.safe_hold import (
    MODE_FLAT,
    MODE_NO_SUN,
    MODE_PYRAMID,
    MODE_PYRAMID_DENIED,
    MODE_SHADOW,
)
from css_estimation.sun.sun_heading import (
    ECLIPSE_ECLIPSED,
    ECLIPSE_SUNLIT,
    PREDICTION_ECLIPSED,
    PREDICTION_SUNLIT,
    UNAIDED,
    UNKNOWN_SKY,
    VALIDITY_HELD,
    VALIDITY_NONE,
    VALIDITY_VALID,
)

DT = 0.5
DEGREE = math.pi / 180.0
reading = st.one_of(st.integers(0, 4095).map(lambda n: n / 4096.0), st.sampled_from([0.0, 0.15, 0.14990234375]))
broken = st.floats(allow_nan=True, allow_infinity=True)
angles = st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 360.0))


class Safe:
    """An estimator on board, fed with outputs."""

    def __init__(self, algorithm, **changes):
        self.algorithm = algorithm
        self.p, self.state = build(algorithm, **changes)

    def step(self, voltages, predicted=PREDICTION_SUNLIT, dt=DT):
        voltages = np.asarray(voltages, dtype=float)
        aiding = UNAIDED._replace(sky=UNKNOWN_SKY._replace(predicted=predicted))
        self.state, heading = self.algorithm.step(self.p, self.state, None, dt, voltages, aiding)
        return heading


def error_deg(heading, sun_b):
    return np.degrees(math.acos(min(1.0, float(np.dot(heading.sun_b, sun_b)))))


def flat_of(voltages, normals=NORMALS):
    """Heading by the words of the paper, the slow way."""
    vector = np.zeros(3)
    for axis in range(3):
        plus = [v for v, n in zip(voltages, normals, strict=True) if n[axis] > 0.999]
        minus = [v for v, n in zip(voltages, normals, strict=True) if n[axis] < -0.999]
        vector[axis] = max(plus) if max(plus) >= max(minus) else -max(minus)
    length = np.linalg.norm(vector)
    return vector / length if length > 0.0 else vector


# Flat cells


def test_flat_cells_are_exact_in_the_light_of_the_sun_alone():
    rng = np.random.default_rng(1)
    safe = Safe(FLAT)
    for sun_b in rng.normal(size=(200, 3)):
        sun_b /= np.linalg.norm(sun_b)
        if np.abs(sun_b).min() > 0.13:  # beyond the drop-out
            heading = safe.step(outputs(sun_b, normals=FLAT_NORMALS))
            assert error_deg(heading, sun_b) < 0.06  # steps of the converter
            assert (heading.mode, heading.validity) == (MODE_FLAT, VALIDITY_VALID)
            assert heading.lit_mask.bit_count() == 3


@settings(max_examples=200, deadline=None)
@given(st.lists(reading, min_size=14, max_size=14))
def test_flat_heading_takes_the_brightest_of_a_face_and_the_brighter_of_opposite_ones(voltages):
    p, _ = build(SWITCH)
    sun_b, mask = flat_heading(p.faces, np.array(voltages))
    np.testing.assert_allclose(sun_b, flat_of(voltages), atol=1e-12)
    used = [i for i in range(14) if mask >> i & 1]
    assert not set(used) & set(PYRAMID)
    for i in used:
        rivals = [j for j in range(14) if abs(NORMALS[j] @ NORMALS[i]) > 0.999]
        assert voltages[i] == max(voltages[j] for j in rivals)


def test_equal_faces_count_as_the_positive_one():
    p, _ = build(FLAT)
    sun_b, _ = flat_heading(p.faces, np.full(14, 0.25))
    assert sun_b == pytest.approx((3**-0.5,) * 3)
    assert flat_heading(p.faces, np.zeros(14)) == ((0.0, 0.0, 0.0), 0)


def test_a_shaded_cell_is_passed_over():
    sun_b = np.array([0.6, 0.64, 0.48])
    voltages = outputs(sun_b, normals=FLAT_NORMALS)
    safe = Safe(FLAT)
    voltages[0] = voltages[4] = 0.1  # one of two, one of three
    assert error_deg(safe.step(voltages), sun_b) < 0.06


def test_wrong_side():
    """The Sun grazes the +z face while the Earth lights the -z face: the sign of z turns (Benton, Fig. 4)."""
    a = 12.0 * DEGREE
    sun_b = np.array([math.cos(a), 0.0, math.sin(a)])
    lit = outputs(sun_b, normals=FLAT_NORMALS)
    weak = outputs(sun_b, 0.19 * np.array([0.0, 0.0, -1.0]), normals=FLAT_NORMALS)
    strong = outputs(sun_b, 0.23 * np.array([0.0, 0.0, -1.0]), normals=FLAT_NORMALS)
    safe = Safe(FLAT)
    assert error_deg(safe.step(lit), sun_b) < 0.06
    assert error_deg(safe.step(weak), sun_b) < 0.06
    wrong = safe.step(strong)
    assert wrong.sun_b[2] < 0.0
    expected = math.atan(0.23 / math.cos(a)) + a
    assert error_deg(wrong, sun_b) == pytest.approx(math.degrees(expected), abs=0.1)


def test_noise_makes_the_wrong_side_chatter():
    """Where both faces are about as bright, the noise of each cycle decides the sign."""
    a = 12.0 * DEGREE
    sun_b = np.array([math.cos(a), 0.0, math.sin(a)])
    albedo = math.sin(a) * np.array([0.0, 0.0, -1.0])
    rng = np.random.default_rng(5)
    safe = Safe(FLAT)
    signs = [
        math.copysign(1.0, safe.step(outputs(sun_b, albedo, normals=FLAT_NORMALS, noise=s)).sun_b[2])
        for s in 0.01 * rng.normal(size=(400, 14))
    ]
    assert 0.35 < np.mean(np.array(signs) > 0.0) < 0.65
    assert 120 < np.count_nonzero(np.diff(signs)) < 280, "like the tosses of a coin"


# Shadow


@pytest.mark.parametrize("algorithm", [FLAT, SWITCH], ids=["flat", "pyramid_switch"])
def test_in_the_shadow_an_axis_stands_in_and_says_so(algorithm):
    safe = Safe(algorithm)
    noise = np.full(14, 0.01)
    lit = outputs(PANEL, normals=NORMALS if algorithm is SWITCH else FLAT_NORMALS)
    for _ in range(3):
        assert safe.step(lit).validity == VALIDITY_VALID
    for _ in range(5):
        heading = safe.step(noise, PREDICTION_ECLIPSED)
        assert heading.sun_b == (1.0, 0.0, 0.0)
        assert (heading.validity, heading.mode, heading.lit_mask) == (VALIDITY_NONE, MODE_SHADOW, 0)
        assert (heading.eclipse, heading.age) == (ECLIPSE_ECLIPSED, 0.0)
    again = safe.step(lit)
    assert (again.validity, again.eclipse) == (VALIDITY_VALID, ECLIPSE_SUNLIT)


@pytest.mark.parametrize("algorithm", [FLAT, SWITCH], ids=["flat", "pyramid_switch"])
def test_dark_cells_in_sunlight_hold_the_last_heading(algorithm):
    safe = Safe(algorithm)
    first = safe.step(outputs(PANEL, normals=NORMALS if algorithm is SWITCH else FLAT_NORMALS))
    held = safe.step(np.zeros(14))
    assert held.sun_b == first.sun_b
    assert (held.validity, held.mode, held.age) == (VALIDITY_HELD, MODE_NO_SUN, DT)


# Pyramid and switch


def test_pyramid_is_exact_within_its_view():
    p, _ = build(SWITCH)
    for angle in (0.0, 5.0, 15.0, 26.0):
        for azimuth in range(0, 360, 15):
            sun_b = off_panel(angle, azimuth)
            heading, bright = pyramid_heading(p.pyramid, outputs(sun_b))
            assert bright
            assert math.degrees(math.acos(min(1.0, np.dot(heading, sun_b)))) < 0.04


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.lists(reading, min_size=14, max_size=14), st.booleans()), min_size=1, max_size=30))
def test_invariants_of_the_switch(cycles):
    """PFCSS at the end of a cycle implies PFMIN; entry needs the flat cells; exit is by PFMIN, or the shadow, alone."""
    safe = Safe(SWITCH)
    adopted = False
    for voltages, dark in cycles:
        heading = safe.step(voltages, PREDICTION_ECLIPSED if dark else PREDICTION_SUNLIT)
        bright = min(voltages[i] for i in PYRAMID) >= 0.15
        flat_b = flat_of(voltages)
        near = float(flat_b @ PANEL) >= math.cos(25.0 * DEGREE)
        expected = not dark and bright and (adopted or near)
        assert (heading.mode == MODE_PYRAMID) == expected == safe.state.adopted
        if dark:
            assert heading.mode == MODE_SHADOW
        elif expected:
            weighted = np.array([voltages[i] for i in PYRAMID]) @ NORMALS[list(PYRAMID)]
            np.testing.assert_allclose(heading.sun_b, weighted / np.linalg.norm(weighted), atol=1e-12)
        elif np.any(flat_b):
            np.testing.assert_allclose(heading.sun_b, flat_b, atol=1e-12)
            assert heading.mode == (MODE_PYRAMID_DENIED if bright else MODE_FLAT)
        adopted = expected


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.lists(st.one_of(reading, broken), min_size=14, max_size=14), broken), max_size=12))
@pytest.mark.parametrize("algorithm", [FLAT, SWITCH], ids=["flat", "pyramid_switch"])
def test_any_reading_gives_a_unit_vector_or_none(algorithm, cycles):
    safe = Safe(algorithm)
    for voltages, dt in cycles:
        heading = safe.step(voltages, dt=dt)
        length = math.sqrt(sum(c * c for c in heading.sun_b))
        assert length == 0.0 if heading.validity == VALIDITY_NONE else abs(length - 1.0) < 1e-9
        assert all(map(math.isfinite, (*heading.omega_bn_b, heading.age)))


@settings(max_examples=200, deadline=None)
@given(angles, st.floats(0.5, 1.0))
def test_fifteen_percent_on_quantised_cells(where, brightness):
    """PFMIN is judged after the converter: 615 of 4096 steps on each cell."""
    voltages = outputs(brightness * off_panel(*where))
    _, bright = pyramid_heading(build(SWITCH)[0].pyramid, voltages)
    assert bright == all(round(voltages[i] * 4096) >= 615 for i in PYRAMID)


@settings(max_examples=300, deadline=None)
@given(st.floats(0.0, 26.0), st.floats(0.0, 360.0), st.floats(70.0, 180.0), st.floats(0.0, 360.0), st.floats(0.3, 0.6))
def test_a_pyramid_that_stares_at_doubled_albedo_is_not_adopted(off, azimuth, sun_off, sun_azimuth, albedo):
    """The Earth's light alone fills the pyramid, while the flat cells see the Sun far from the panels.

    0.6 of the Sun is the most that doubled albedo gives at 475 km, and within 60 deg of the Sun it is weak.
    """
    earth_b, sun_b = albedo * off_panel(off, azimuth), off_panel(sun_off, sun_azimuth)
    safe = Safe(SWITCH)
    voltages = outputs(sun_b, earth_b)
    for _ in range(5):
        assert safe.step(voltages).mode != MODE_PYRAMID


def test_the_stare_is_denied_and_says_so():
    safe = Safe(SWITCH)
    heading = safe.step(outputs(off_panel(120.0), 0.6 * PANEL))
    assert heading.mode == MODE_PYRAMID_DENIED
    assert error_deg(heading, PANEL) > 25.0


def test_adopted_pyramid_keeps_the_sun_while_albedo_drags_the_flat_cells_away():
    """No test of 25 deg on the way out: the hysteresis."""
    safe = Safe(SWITCH)
    sun_b = off_panel(5.0)
    assert safe.step(outputs(sun_b)).mode == MODE_PYRAMID
    # from the side, where the collar hides it from the pyramid
    for albedo in (0.2, 0.5, 0.7):
        voltages = outputs(sun_b, albedo * off_panel(80.0, 90.0))
        heading = safe.step(voltages)
        assert heading.mode == MODE_PYRAMID
        assert error_deg(heading, sun_b) < 0.04
    assert np.degrees(math.acos(flat_of(voltages) @ PANEL)) > 25.0
    fresh = Safe(SWITCH)
    assert fresh.step(voltages).mode == MODE_PYRAMID_DENIED


def test_leaving_the_view_returns_to_the_flat_cells_in_the_same_cycle():
    safe = Safe(SWITCH)
    assert safe.step(outputs(off_panel(10.0))).mode == MODE_PYRAMID
    away = off_panel(50.0, 30.0)
    heading = safe.step(outputs(away))
    assert heading.mode == MODE_FLAT
    assert error_deg(heading, away) < 8.0
    # within view of all three cells, but not near enough to be adopted anew
    assert safe.step(outputs(off_panel(26.0, 60.0))).mode == MODE_PYRAMID_DENIED


def test_the_jump_from_cells_to_cells_is_no_rate():
    safe = Safe(SWITCH)
    sun_b = off_panel(3.0)
    dragged = outputs(sun_b, 0.7 * off_panel(80.0, 90.0))
    assert safe.step(dragged).mode != MODE_PYRAMID
    safe.step(dragged)
    heading = safe.step(outputs(sun_b))
    assert heading.mode == MODE_PYRAMID
    assert np.linalg.norm(heading.omega_bn_b) < 1e-9


# Parameters


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"cells__normals": [1.0, 0.0, 0.0]}, "flat.cells: no cell on -x, +y, -y, +z, -z"),
        ({"flat__cells": [0, 99]}, "flat.cells: 99 given, expected numbers from 0 to 13"),
        ({"flat__cells": [11]}, "flat.cells: cell 11 given, but its normal is along no body axis"),
        ({"pyramid__cells": [11, 12]}, "pyramid.cells: cells [11, 12] of 14, expected three different ones"),
        ({"pyramid__cells": [11, 12, 12]}, "pyramid.cells: cells [11, 12, 12] of 14, expected three different ones"),
        ({"pyramid__cells": [11, 12, 99]}, "pyramid.cells: cells [11, 12, 99] of 14, expected three different ones"),
        ({"pyramid__cells": [0, 11, 12]}, "pyramid.cells: normals of cells [0, 11, 12] have cosines up to 0.816"),
    ],
)
def test_layouts_that_do_not_fit_are_named(changes, reason):
    given_values = {"cells__normals": NORMALS.ravel().tolist(), **changes}
    reasons = list(SWITCH.conflicts(default_values(SHARED + SWITCH.PARAMETERS, **given_values)))
    assert any(r.startswith(reason) for r in reasons), reasons


def test_cells_may_be_named_instead_of_derived():
    derived, _ = build(SWITCH)
    named, _ = build(SWITCH, flat__cells=list(range(11)), pyramid__cells=[11, 12, 13])
    np.testing.assert_array_equal(named.faces, derived.faces)
    assert named.pyramid == derived.pyramid
    assert not list(
        SWITCH.conflicts(default_values(SHARED + SWITCH.PARAMETERS, cells__normals=NORMALS.ravel().tolist()))
    )
