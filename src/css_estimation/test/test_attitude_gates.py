# SPDX-License-Identifier: Apache-2.0
"""Which measurements the converged attitude filter refuses: 99.9 % of chi-square, by dense algebra of one update."""

import copy

import numpy as np
import pytest
from attitude_scene import FACES, NO_LIGHT, SUN_N, Run, Scene, options
from scipy.stats import chi2

from css_common.attitude import mrp_to_dcm
from css_common.kernel import typed_call
from css_common.vectors import vector_of
from css_estimation.attitude import attitude_update
from css_estimation.attitude.attitude_solution import USED_FIELD, USED_SUN
from css_estimation.attitude.slow_errors import FIELD, FIELD_RATE, MAGNETOMETER

_measure = typed_call(attitude_update.measure)
NOTHING = np.full(6, np.nan)
NO_FIELD = ((0.0, 0.0, 0.0), False)
CELL_VARIANCE, FIELD_VARIANCE = 0.02**2, 200e-9**2


class Converged:
    """A filter after a minute of exact measurements, and its prediction of the next ones."""

    def __init__(self, **changes):
        scene = Scene(3, noise=0.0)
        self.run = Run(options(**changes))
        for _ in range(60):
            scene.advance()
            self.run.step(scene)
        self.references = scene.references()
        dcm = np.array(mrp_to_dcm(self.run.state.sigma_bn))
        self.sun_b, self.field_b = dcm @ SUN_N, dcm @ scene.field_n
        self.p = self.run.memory.covariance[:3, :3]
        self.neglected = (np.trace(self.p) / 3.0) ** 2
        self.lit = np.flatnonzero(FACES @ self.sun_b > 0.2)

    def measure(self, voltages=NOTHING, field=NO_FIELD, p=None):
        """State and tally after measurements; the filter itself stays as it is."""
        run = self.run
        memory = copy.deepcopy(run.memory)
        field_b, given = field
        return _measure(
            p or run.p,
            run.state,
            memory,
            voltages,
            vector_of(np.asarray(field_b)),
            given,
            True,
            self.references,
            NO_LIGHT,
        )

    def cell(self, i, q):
        """Outputs with one cell alone, its normalised innovation squared `q` with the sign of `q`."""
        h = np.cross(FACES[i], self.sun_b)
        s = h @ self.p @ h + CELL_VARIANCE + self.neglected
        voltages = NOTHING.copy()
        voltages[i] = FACES[i] @ self.sun_b + np.sign(q) * np.sqrt(abs(q) * s)
        return voltages


@pytest.fixture(scope="module")
def converged():
    return Converged()


def test_it_has_converged_on_a_sun_that_several_cells_see(converged):
    assert np.trace(converged.p) < converged.run.p.gated_below and len(converged.lit) >= 2


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_gate_of_a_single_cell_is_that_of_one_degree_of_freedom(converged, sign):
    limit = chi2.isf(1e-3, 1)
    for i in converged.lit.tolist():
        state, tally = converged.measure(converged.cell(i, sign * 0.99 * limit))
        assert (tally.lit_mask, tally.taken, tally.used, tally.refused) == (1 << i, 1, USED_SUN, False)
        assert tally.nis == pytest.approx(0.99 * limit, rel=1e-6)
        assert state.sigma_bn != converged.run.state.sigma_bn
        state, tally = converged.measure(converged.cell(i, sign * 1.01 * limit))
        assert (tally.taken, tally.used, tally.nis, tally.refused) == (0, 0, 0.0, True)
        assert state == converged.run.state


def test_one_cell_that_is_refused_leaves_the_others_in(converged):
    good, bad = (np.maximum(FACES @ converged.sun_b, 0.0) for _ in range(2))
    outlier = int(converged.lit[0])
    bad[outlier] = converged.cell(outlier, 40.0)[outlier]
    _, all_good = converged.measure(good)
    _, tally = converged.measure(bad)
    assert all_good.taken == np.count_nonzero(good) == tally.taken + 1
    assert tally.lit_mask == all_good.lit_mask & ~(1 << outlier)
    assert not tally.refused and tally.used == USED_SUN


def test_before_it_has_converged_nothing_is_refused(converged):
    ungated = converged.run.p._replace(gated_below=0.0)
    i = int(converged.lit[0])
    _, tally = converged.measure(converged.cell(i, 40.0), p=ungated)
    assert (tally.lit_mask, tally.taken, tally.refused) == (1 << i, 1, False)
    assert tally.nis == pytest.approx(40.0, rel=1e-6)


def directions(count, seed):
    """(count, 3) unit vectors."""
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_the_gate_of_the_field_is_that_of_two():
    converged = Converged(error_model="white")
    limit = chi2.isf(1e-3, 2)
    strength = np.linalg.norm(converged.field_b)
    along = converged.field_b / strength
    rows = np.linalg.svd(along[None])[2][1:]  # two axes across the field
    h = np.cross(rows, along)
    s = h @ converged.p @ h.T + (FIELD_VARIANCE / strength**2 + converged.neglected) * np.eye(2)
    for off in directions(10, 1) @ rows.T:
        unit = off / np.sqrt(off @ np.linalg.solve(s, off))
        for share, taken in ((0.99, True), (1.01, False)):
            field_b = converged.field_b + strength * np.sqrt(share * limit) * unit @ rows
            _, tally = converged.measure(field=(field_b, True))
            assert (tally.taken, tally.used, tally.refused) == ((2, USED_FIELD, False) if taken else (0, 0, True))
            assert tally.nis == pytest.approx(share * limit if taken else 0.0, rel=1e-6)


def test_the_gate_of_a_field_that_errs_lastingly_is_that_of_three(converged):
    limit = chi2.isf(1e-3, 3)
    strength = np.linalg.norm(converged.field_b)
    x, y, z = converged.field_b
    whole = converged.run.memory.covariance
    h = np.zeros((3, len(whole)))
    h[:, :3] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    h[:, MAGNETOMETER:FIELD] = np.eye(3)
    h[:, FIELD:FIELD_RATE] = mrp_to_dcm(converged.run.state.sigma_bn)
    s = h @ whole @ h.T + (FIELD_VARIANCE + converged.neglected * strength**2) * np.eye(3)
    for off in directions(10, 4):
        unit = off / np.sqrt(off @ np.linalg.solve(s, off))
        for share, taken in ((0.98, True), (1.02, False)):
            field_b = converged.field_b + np.sqrt(share * limit) * unit
            _, tally = converged.measure(field=(field_b, True))
            assert (tally.taken, tally.used, tally.refused) == ((3, USED_FIELD, False) if taken else (0, 0, True))
            # the filter believes in a bias of a few nT by now
            assert tally.nis == pytest.approx(share * limit if taken else 0.0, rel=0.02)


def test_the_gate_of_a_sun_vector_is_that_of_three():
    converged = Converged(sun_model="vector")
    assert len(converged.lit) == 3  # of faces: N^T N is one
    limit = chi2.isf(1e-3, 3)
    x, y, z = converged.sun_b
    h = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s = h @ converged.p @ h.T + (CELL_VARIANCE + converged.neglected) * np.eye(3)
    for off in directions(10, 2):
        unit = off / np.sqrt(off @ np.linalg.solve(s, off))
        for share, taken in ((0.99, True), (1.01, False)):
            voltages = np.zeros(6)
            vector = converged.sun_b + np.sqrt(share * limit) * unit
            voltages[converged.lit] = FACES[converged.lit] @ vector
            _, tally = converged.measure(voltages)
            assert (tally.taken, tally.used, tally.refused) == ((3, USED_SUN, False) if taken else (0, 0, True))
            assert tally.nis == pytest.approx(share * limit if taken else 0.0, rel=1e-6)


@pytest.mark.parametrize("gap", [10.0, 10.5, 500.0])
def test_a_gap_that_cannot_be_bridged_lets_the_bias_walk_on(converged, gap):
    """The attitude is lost beyond `longest_step`, 10 s; the variance of the bias grows by its walk either way."""
    run = copy.deepcopy(converged.run)
    before = run.memory.covariance.copy()
    run.step(Scene(3), gap, voltages=np.zeros(6), field=(0.0, 0.0, 0.0), valid=False)
    grown = np.diag(run.memory.covariance)[3:6] - np.diag(before)[3:6]
    np.testing.assert_allclose(grown, run.p.bias_noise * gap, rtol=1e-6)
    assert run.state.aligned == (gap <= 10.0)
