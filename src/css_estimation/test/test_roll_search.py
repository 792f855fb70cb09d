# SPDX-License-Identifier: Apache-2.0
"""The search over all rolls about the field, and the false attitudes that it keeps a filter from."""

import math

import numpy as np
import pytest
from attitude_scene import FACES, NO_LIGHT, SUN_N, Run, Scene, guess, options
from scipy.spatial.transform import Rotation

from css_common.attitude import mrp_to_dcm
from css_environment.albedo import new_workspace
from css_estimation.attitude import roll_search
from css_estimation.attitude.flight_references import References
from css_estimation.sun.cell_calibration import nominal

FOUR = FACES[:4]
FIELD_N = (2e-5, 2.5e-5, -1e-5)


def mrp_of(attitude):
    """MRP of an attitude that turns vectors from n to b."""
    x, y, z, w = attitude.inv().as_quat(canonical=True)
    return tuple(float(c / (1.0 + w)) for c in (x, y, z))


class Search:
    """Of a body at rest that sees Sun and field without noise."""

    def __init__(self, seed, normals=FACES, variance=math.inf, begun_at=None):
        self.attitude = Rotation.random(random_state=np.random.default_rng(seed))
        self.cells, self.calibration = options(normals).cells, nominal(len(normals))
        self.normals, self.weights = np.asarray(normals), roll_search.new_weights()
        self.field_b = tuple(self.attitude.apply(FIELD_N).tolist())
        begun_at = begun_at or Rotation.random(random_state=np.random.default_rng(seed + 100))
        laid_bn = roll_search.laid_on(mrp_of(begun_at), FIELD_N, self.along_b)
        self.search = roll_search.begin(self.weights, laid_bn, variance)

    @property
    def along_b(self):
        return tuple((np.array(self.field_b) / np.linalg.norm(self.field_b)).tolist())

    def weigh(self, times=5, dt=1.0, voltages=None):
        seen = np.maximum(self.normals @ self.attitude.apply(SUN_N), 0.0)
        for _ in range(times):
            self.search = roll_search.weigh(
                self.cells,
                self.calibration,
                self.search,
                self.weights,
                dt,
                seen if voltages is None else voltages,
                (1 << len(seen)) - 1,
                self.field_b,
                References(SUN_N, 1.0, True, FIELD_N),
                NO_LIGHT,
                0.0,
                new_workspace(),
                np.zeros(len(seen)),
            )
        return roll_search.verdict(self.search, self.weights, self.field_b)

    def error(self, sigma_bn):
        """Angle [rad] of an attitude from the true one, and its part about the field."""
        turn = (self.attitude * Rotation.from_matrix(np.array(mrp_to_dcm(sigma_bn))).inv()).as_rotvec()
        return float(np.linalg.norm(turn)), float(turn @ np.array(self.along_b))


def test_laid_on_the_field_an_attitude_turns_the_shortest_way():
    search = Search(1)
    before = Rotation.random(random_state=np.random.default_rng(7))
    laid_bn = roll_search.laid_on(mrp_of(before), FIELD_N, search.along_b)
    laid = np.array(mrp_to_dcm(laid_bn))
    np.testing.assert_allclose(laid @ FIELD_N, search.field_b, atol=1e-18)
    turned = (Rotation.from_matrix(laid) * before.inv()).magnitude()
    off = np.arccos(np.dot(before.apply(FIELD_N), search.field_b) / np.dot(FIELD_N, FIELD_N))
    assert turned == pytest.approx(off, abs=1e-9)
    opposite = roll_search.laid_on(laid_bn, FIELD_N, tuple(-c for c in search.along_b))
    np.testing.assert_allclose(np.array(mrp_to_dcm(opposite)) @ FIELD_N, np.negative(search.field_b), atol=1e-17)


@pytest.mark.parametrize("seed", range(12))
def test_the_true_roll_is_found_from_any(seed):
    search = Search(seed)
    verdict = search.weigh()
    error, roll = search.error(verdict.sigma_bn)
    assert verdict.found
    assert abs(roll) == pytest.approx(error, abs=1e-6), "across the field nothing errs"
    assert abs(roll) < 3.0 * math.sqrt(verdict.variance) < np.radians(30.0)


def test_hypotheses_turn_with_the_body():
    search = Search(3)
    search.weigh()
    turn = np.array([0.3, -0.2, 0.5])
    search.search = roll_search.turned(search.search, tuple(turn.tolist()), 1.0)
    search.attitude = Rotation.from_rotvec(-turn) * search.attitude
    search.field_b = tuple(search.attitude.apply(FIELD_N).tolist())
    verdict = search.weigh(times=1)
    assert verdict.found and search.error(verdict.sigma_bn)[0] < np.radians(8.0)


def test_two_rolls_that_fit_alike_are_no_verdict():
    """Cells in a plane across the field, and the Sun mirrored by the roll: two rolls, until a guess tells."""
    field = np.array(FIELD_N) / np.linalg.norm(FIELD_N)
    # one cell along the field: all rolls are alike
    search = Search(4, normals=[[1.0, 0.0, 0.0]] * 2)
    search.normals = np.tile(search.along_b, (2, 1))
    search.cells = options(search.normals).cells
    assert not search.weigh(times=30).found
    assert np.dot(field, SUN_N) > 0.1
    # a cell across it: its mirror image fits as well
    across = np.cross(search.along_b, [0.0, 0.0, 1.0])
    normals = np.array([across / np.linalg.norm(across)] * 2)
    seen = Search(4, normals=normals)
    if normals[0] @ seen.attitude.apply(SUN_N) < 0.2:
        normals = np.negative(normals)
    blind = Search(4, normals=normals)
    assert not blind.weigh(times=30).found
    guessed = Search(4, normals=normals, variance=np.radians(12.0) ** 2, begun_at=blind.attitude)
    verdict = guessed.weigh(times=5)
    assert verdict.found and guessed.error(verdict.sigma_bn)[0] < np.radians(10.0)


def test_outputs_that_fit_no_roll_are_no_verdict():
    search = Search(5)
    rng = np.random.default_rng(2)
    assert not search.weigh(times=20, voltages=rng.uniform(0.4, 1.0, 6)).found


@pytest.mark.parametrize("seed", range(6))
def test_a_failed_cell_does_not_decide(seed):
    search = Search(seed)
    voltages = np.maximum(FACES @ search.attitude.apply(SUN_N), 0.0)
    voltages[int(np.argmin(voltages))] = 3.0
    verdict = search.weigh(times=10, voltages=voltages)
    assert not verdict.found or search.error(verdict.sigma_bn)[0] < np.radians(15.0)


# Starts from which a filter that lets field and cells narrow any attitude settled wrongly with four diodes in a plane:
# up to 43 deg off after 80 s, sure of 1 deg.
FALSE_STARTS = (1122, 1152, 1223, 1340, 1367, 1399, 1670, 2413)


def flown(seed, normals=FOUR, steps=80, **changes):
    """The filter from a guess 20 deg off about each axis, 1 sigma."""
    scene = Scene(seed, normals=normals)
    run = Run(options(normals, start__attitude="given", start__sigma_deg=20.0, **changes))
    run.state = run.state._replace(sigma_bn=guess(scene, 20.0))
    for k in range(steps):
        run.step(scene, 1.0 if k else 0.0)
        if k < steps - 1:
            scene.advance()
    return run, scene


@pytest.mark.parametrize("errors_are", ["lasting", "white"])
@pytest.mark.parametrize("seed", FALSE_STARTS)
def test_no_start_ends_in_a_false_attitude(seed, errors_are):
    run, scene = flown(seed, error_model=errors_are)
    assert run.state.confirmed
    # 99.9 % of chi-square of three, that one of the sixteen may graze
    assert run.nees(scene) < 25.0 and run.error_deg(scene) < 4.0


@pytest.mark.parametrize(("errors_are", "confirmed"), [("lasting", True), ("white", False)])
def test_where_cells_never_make_a_vector_they_tell_the_roll_all_the_same(errors_are, confirmed):
    """But to the paper's filter, which knows vectors alone: it is left with the field."""
    run, scene = flown(1223, sun_model="vector", error_model=errors_are)
    assert run.state.confirmed == confirmed
    assert run.nees(scene) < 16.27


def test_the_field_alone_keeps_the_roll_open():
    """From a guess far off, without a Sun: what the field leaves open stays as open as it was."""
    scene = Scene(1223, normals=FOUR)
    run = Run(options(FOUR, start__attitude="given", start__sigma_deg=20.0))
    run.state = run.state._replace(sigma_bn=guess(scene, 20.0))
    for k in range(30):
        run.step(scene, 1.0 if k else 0.0, sunlit=False)
        scene.advance()
    along = np.array(mrp_to_dcm(run.state.sigma_bn)) @ scene.field_n
    along /= np.linalg.norm(along)
    assert np.degrees(np.sqrt(along @ run.memory.covariance[:3, :3] @ along)) > 15.0
    assert run.nees(scene) < 16.27


def test_a_false_attitude_is_doubted_and_given_up():
    """Converged, then rolled about the field behind the filter's back: the field agrees, the cells refuse."""
    run, scene = flown(3, steps=150)
    along = np.array(mrp_to_dcm(run.state.sigma_bn)) @ scene.field_n
    rolled = Rotation.from_rotvec(np.radians(40.0) * along / np.linalg.norm(along)) * Rotation.from_matrix(
        np.array(mrp_to_dcm(run.state.sigma_bn))
    )
    run.state = run.state._replace(sigma_bn=mrp_of(rolled))
    for _ in range(90):
        scene.advance()
        run.step(scene)
    assert run.error_deg(scene) < 2.0 and run.nees(scene) < 20.0


@pytest.mark.parametrize("seed", range(6))
def test_a_guess_that_is_not_what_it_claims_is_given_up(seed):
    """60 deg off about each axis, 1 sigma, where 3 are claimed: within five minutes nothing of it is left."""
    normals = FOUR if seed % 2 else FACES
    scene = Scene(seed, normals=normals)
    run = Run(options(normals, start__attitude="given", start__sigma_deg=3.0))
    run.state = run.state._replace(sigma_bn=guess(scene, 60.0))
    for k in range(300):
        run.step(scene, 1.0 if k else 0.0)
        if k < 299:
            scene.advance()
    assert run.state.confirmed and run.nees(scene) < 16.27
