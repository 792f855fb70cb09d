# SPDX-License-Identifier: Apache-2.0
"""Scale errors of cells, estimated with the attitude or considered: what is found, and what the heading gains."""

import numpy as np
import pytest
from attitude_scene import FACES, Run, Scene, guess, options

SCALES = 1.0 + np.array([0.2, -0.15, 0.05, -0.2, 0.1, 0.12])
STEPS, SETTLED = 1500, 600


def fly(seed, scales=SCALES, normals=FACES, **changes):
    """Run, and mean angles [deg] of estimated to true Sun and attitude once settled."""
    scene = Scene(seed, scales=scales, normals=normals)
    run = Run(options(sun_model="voltage", start__attitude="given", start__sigma_deg=3.0, **changes))
    # a start 3 deg off, which needs no calibrated cells
    run.state = run.state._replace(sigma_bn=guess(scene, 3.0))
    headings, attitudes = [], []
    for k in range(STEPS):
        run.step(scene, 1.0 if k else 0.0)
        if k >= SETTLED:
            attitudes.append(run.error_deg(scene))
            headings.append(run.heading_error_deg(scene))
        scene.advance()
    return run, float(np.mean(headings)), float(np.mean(attitudes))


@pytest.fixture(scope="module")
def calibrated():
    return [fly(seed, calibration__mode="estimate", calibration__scale_sigma=0.15) for seed in (1, 2, 3)]


def test_scale_errors_of_five_to_twenty_percent_are_found(calibrated):
    for run, _, _ in calibrated:
        found = run.memory.calibration[:, 0]
        sigma = np.sqrt(np.diag(run.memory.covariance)[run.p.cells.calibration_at :])
        # in some tumbles the Sun never comes near the normal of one face
        seen = sigma < 0.02
        assert np.count_nonzero(seen) >= 5
        assert np.abs(found - SCALES)[seen].max() < 0.02
        assert (np.abs(found - SCALES) < 4.0 * sigma).all()


def test_the_heading_gains_by_calibration(calibrated):
    """Against a filter that knows of the errors and trusts the cells less: what it can do without calibration."""
    trusting = [fly(seed, cell_sigma=0.1) for seed in (1, 2, 3)]
    gained = np.mean([heading for _, heading, _ in calibrated])
    assert gained < 0.6 * np.mean([heading for _, heading, _ in trusting])
    perfect = np.mean([fly(seed, scales=1.0)[1] for seed in (1, 2, 3)])
    assert gained < 1.3 * perfect


def test_considered_errors_stay_and_keep_the_filter_honest():
    run, heading, _ = fly(1, calibration__mode="consider", calibration__scale_sigma=0.15)
    np.testing.assert_array_equal(run.memory.calibration[:, 0], 1.0)
    np.testing.assert_allclose(np.diag(run.memory.covariance)[run.p.cells.calibration_at :], 0.15**2)
    assert heading < fly(1)[1]


def test_alignment_is_found_too():
    rng = np.random.default_rng(8)
    tilted = FACES + np.radians(2.0) * rng.normal(size=FACES.shape)
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    changes = {"calibration__mode": "estimate", "calibration__alignment": True, "calibration__scale_sigma": 0.15}
    scene_run, heading, _ = fly(4, normals=tilted, **changes)
    off = np.abs(scene_run.memory.calibration[:, 0] - SCALES)
    # the Sun may meet a cell at one angle alone, which its scale and its tilt explain equally well: it says so
    assert (off < 4.0 * np.sqrt(np.diag(scene_run.memory.covariance)[scene_run.p.cells.calibration_at :: 3])).all()
    assert np.count_nonzero(off < 0.01) >= 4
    assert heading < 0.8 * fly(4, normals=tilted, calibration__mode="estimate", calibration__scale_sigma=0.15)[1]
