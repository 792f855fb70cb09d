# SPDX-License-Identifier: Apache-2.0
"""Every Sun estimator on every layout, the Sun everywhere, at rest: what the lit cells tell is what it must be.

What is expected follows from the cells that see the Sun and from nothing else. Three with independent normals give the
direction, one gives its own view, none gives no heading.
"""

import math

import numpy as np
import pytest
from presence import present

from css_estimation.sun import least_squares, sunline_suekf, wavg
from css_estimation.sun.cell_layout import cell_layout
from css_estimation.sun.offered import estimators
from css_estimation.sun_filter import sun_filter
from css_papers.best import headings
from css_papers.best.headings import all_layouts, directions, over_the_sky, values_of

COUNT, CYCLES = 60, 100
SKY = directions(COUNT)
KINDS = estimators()
# filters: a cell error of 0.1 in each of 100 cycles against one of 1 rad at the start leaves a part of 1e-4 of that
CONVERGED_DEG = 0.5
# those that do not take the normal Sun for granted have a light, or an Earth, to tell from it: their error bars count
WITH_LIGHT = (sun_filter, sunline_suekf)
NOISE = 0.02


class Scene:
    """The cells of a layout with the Sun in each direction of the sky."""

    def __init__(self, kind, layout):
        self.cells = cell_layout(values_of(kind, layout))
        self.normals = np.column_stack([self.cells.cells[c] for c in ("nx", "ny", "nz")])
        self.outputs = np.array([headings.outputs_of(self.cells, sun) for sun in SKY])
        self.half_view_deg = math.degrees(math.acos(min(1.0, max(0.0, self.cells.cos_half_view))))
        lit = self.outputs > 0.0
        self.count = lit.sum(axis=1)
        self.rank = np.array([np.linalg.matrix_rank(self.normals[row]) if row.any() else 0 for row in lit])

    def averages(self, chosen):
        """Eq. 2 over the cells that see the Sun, in the chosen directions."""
        total = self.outputs[chosen] @ self.normals
        return total / np.linalg.norm(total, axis=1, keepdims=True)

    def off_the_span_deg(self):
        """Angle of the Sun to the span of the lit normals."""
        angles = []
        for sun, row in zip(SKY, self.outputs > 0.0, strict=True):
            n = self.normals[row]
            inside = n.T @ np.linalg.lstsq(n.T, sun, rcond=None)[0]
            angles.append(math.degrees(math.acos(min(1.0, float(np.linalg.norm(inside))))))
        return np.array(angles)


PAIRS = [(name, layout) for name in KINDS for layout in all_layouts() if values_of(KINDS[name], layout) is not None]


@pytest.fixture(scope="module", params=PAIRS, ids=lambda pair: f"{pair[0]} on {pair[1]}")
def flown(request):
    name, layout = request.param
    return KINDS[name], Scene(KINDS[name], layout), headings.headings(KINDS[name], layout, SKY, cycles=CYCLES)


def test_layouts_that_an_estimator_cannot_have_are_refused_by_name():
    """Flat cells need a face each, a collared pyramid three orthogonal cells beside them; all others take any."""
    refused = {name: [y for y in all_layouts() if values_of(kind, y) is None] for name, kind in KINDS.items()}
    assert {name for name, layouts in refused.items() if layouts} == {"flat", "pyramid_switch"}
    assert refused["flat"] == ["dual pyramid", "single pyramid", "four coplanar"]


def test_three_independent_lit_cells_give_the_sun(flown):
    kind, scene, found = flown
    spanned = scene.rank == 3
    if not spanned.any():
        return
    error = found.error_deg[spanned]
    assert found.valid[spanned].all()
    if kind.algorithm is wavg:
        np.testing.assert_allclose(found.sun_b[spanned], scene.averages(spanned), atol=1e-12)
    elif kind.algorithm is least_squares:
        # a cell that its weight, its own output, puts below one over the square of the condition number is not asked
        assert error.max() < math.degrees(math.asin(1e-2))
    elif kind.algorithm in WITH_LIGHT:
        assert (error < 3.0 * sigma_deg(found.covariance[spanned])).all()
    else:
        assert error.max() < CONVERGED_DEG


def test_one_lit_cell_gives_its_view(flown):
    kind, scene, found = flown
    single = (scene.count == 1) & found.valid
    # estimators that know which cells are dark may leave the normal, not the view
    of_cell = np.argmax(scene.outputs, axis=1)
    from_normal = np.sum(found.sun_b * scene.normals[of_cell], axis=1)
    slack_deg = 2.0 if kind.algorithm in WITH_LIGHT else CONVERGED_DEG
    assert (np.degrees(np.arccos(np.clip(from_normal[single], -1.0, 1.0))) <= scene.half_view_deg + slack_deg).all()


def test_no_lit_cell_gives_no_heading(flown):
    _, scene, found = flown
    assert not found.valid[scene.count == 0].any()


def test_a_layout_that_sees_the_sun_says_so(flown):
    """Above the dimmest light that an estimator takes for the Sun."""
    _, scene, found = flown
    bright = scene.outputs.max(axis=1) > 0.35
    assert found.valid[bright].all()


def sigma_deg(covariance):
    """Mean error bar of the two axes across the Sun line."""
    return np.degrees(np.sqrt(0.5 * (covariance[:, 0] + covariance[:, 4] + covariance[:, 8])))


@pytest.mark.parametrize("layout", ["dual pyramid", "single pyramid", "four coplanar"])
def test_least_norm_is_off_by_the_angle_of_the_sun_to_the_span_of_the_lit_cells(layout):
    scene = Scene(KINDS["wls"], layout)
    found = headings.headings(KINDS["wls"], layout, SKY, cycles=1)
    chosen = (scene.rank < 3) & present(found).valid
    np.testing.assert_allclose(present(found).error_deg[chosen], scene.off_the_span_deg()[chosen], atol=1e-5)


@pytest.mark.parametrize("name", [name for name in KINDS if (name, "six faces") in PAIRS])
def test_noise_of_the_cells_is_noise_of_the_heading(name):
    """Two components across the Sun with an error of 0.02 each are off by 1.4 deg on average."""
    kind = KINDS[name]
    found = over_the_sky(present(headings.headings(kind, "six faces", SKY, noise=NOISE, cycles=CYCLES)))
    quiet = over_the_sky(present(headings.headings(kind, "six faces", SKY, cycles=CYCLES)))
    across_deg = math.degrees(NOISE * math.sqrt(math.pi / 2.0))
    assert present(found.mean_deg) < present(quiet.mean_deg) + 1.2 * across_deg
    assert found.not_valid == 0.0


SUN_B = np.array([0.300, 0.316, 0.900]) / math.sqrt(0.3**2 + 0.316**2 + 0.9**2)


@pytest.mark.parametrize("name", [name for name in KINDS if (name, "six faces") in PAIRS])
def test_dim_cells_of_six_faces_count(name):
    """Two cells read a third of the brightest: a gate for views of 120 deg has them for Earth, and errs by 25.8 deg."""
    found = headings.headings(KINDS[name], "six faces", SUN_B[None, :], cycles=CYCLES)
    bar = 3.0 * sigma_deg(present(found).covariance)[0] if KINDS[name].algorithm in WITH_LIGHT else CONVERGED_DEG
    assert present(found).valid[0] and present(found).error_deg[0] < bar


@pytest.mark.parametrize("name", ["wavg", "wls"])
def test_a_gate_alone_has_dim_cells_for_earth(name):
    algorithm = KINDS[name].algorithm
    p = algorithm.parameters(values_of(KINDS[name], "six faces"))
    p = p._replace(snapshot=p.snapshot._replace(gate=p.snapshot.gate._replace(dimmest=math.inf)))
    voltages = np.concatenate([SUN_B, np.zeros(3)])
    _, heading = algorithm.step(p, algorithm.initial_state(p), None, 0.1, voltages, headings.AT_REST)
    assert math.degrees(math.acos(heading.sun_b @ SUN_B)) == pytest.approx(25.8, abs=0.1)


@pytest.mark.parametrize("name", ["wavg", "wls"])
def test_of_cells_that_look_away_from_each_other_the_dimmer_sees_the_earth(name):
    """The Earth lights three faces of a cube with less than the Sun gives their opposites: nothing changes."""
    kind = KINDS[name]
    values = values_of(kind, "six faces")
    algorithm = kind.algorithm
    p = algorithm.parameters(values)
    for earth in (0.0, 0.25):
        voltages = np.concatenate([SUN_B, np.full(3, earth)])
        _, heading = algorithm.step(p, algorithm.initial_state(p), None, 0.1, voltages, headings.AT_REST)
        np.testing.assert_allclose(heading.sun_b, SUN_B, atol=1e-12)
        assert heading.lit_mask == 0b111
