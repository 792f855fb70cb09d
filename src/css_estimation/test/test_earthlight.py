# SPDX-License-Identifier: Apache-2.0
"""Attitude from cells and orbit: what the light of the Earth tells about the turn around the Sun line."""

import numpy as np
import pytest
from cell_layouts import LAYOUTS
from scipy.spatial.transform import Rotation
from sun_filter_flight import SunFilterFlight

from css_common.attitude import dcm_to_mrp
from css_common.vectors import unit
from css_estimation.attitude.attitude_solution import VALIDITY_HELD, VALIDITY_NONE, VALIDITY_VALID
from css_estimation.sun_filter import earthlight, options

TURNING = (0.004, -0.003, 0.002)


class EarthlightFlight(SunFilterFlight):
    """The same body, with `earthlight` on board."""

    algorithm = earthlight

    def attitude_error(self, solution):
        """Rotation vector [rad] in b from the estimated to the true attitude."""
        estimated = Rotation.from_mrp(solution.sigma_bn).as_matrix().T
        return Rotation.from_matrix((np.array(self.dcm_bn) @ estimated.T).T).as_rotvec()


def flight(layout="dual pyramid", seed=1):
    sun_b = unit((0.2, 0.3, 0.93))
    return EarthlightFlight(sun_b, TURNING, seed, white=0.005, earth=(0.3, 0.9, 0.2), **LAYOUTS[layout])


def test_the_error_of_the_true_attitude_is_none():
    body = flight()
    solution = body.fly(1.0)._replace(sigma_bn=dcm_to_mrp(body.dcm_bn))
    assert np.abs(body.attitude_error(solution)).max() < 1e-9


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_three_axes_without_a_magnetometer(seed):
    body = flight(seed=seed)
    first = body.fly(5.0, gyro=True)
    assert first.validity == VALIDITY_NONE
    solution = body.fly(600.0, gyro=True)
    assert solution.validity == VALIDITY_VALID
    error = body.attitude_error(solution)
    assert np.degrees(np.linalg.norm(error)) < 5.0
    covariance = body.memory.covariance
    assert np.array_equal(covariance, covariance.T) and np.linalg.eigvalsh(covariance).min() > 0.0
    # the turn about the Sun line is what is known least, and the error bar says so
    values, axes = np.linalg.eigh(covariance[:3, :3])
    assert abs(axes[:, 2] @ np.array(body.sun_b)) > 0.99 and values[2] > 4.0 * values[1]
    assert error @ np.linalg.solve(covariance[:3, :3], error) < 16.3  # 99.9 % of chi-square


def test_in_the_dark_the_attitude_is_held():
    body = flight()
    body.fly(600.0, gyro=True)
    solution = body.fly(60.0, gyro=True, part=0.0)
    assert solution.validity == VALIDITY_HELD and solution.age == pytest.approx(60.0, abs=0.2)
    assert np.degrees(np.linalg.norm(body.attitude_error(solution))) < 5.0


def test_without_an_orbit_there_is_no_attitude():
    body = flight()
    body.sky = body.sky._replace(known=False)
    assert body.fly(100.0, gyro=True).validity == VALIDITY_NONE


def test_it_has_all_parameters_of_the_filter_that_it_carries():
    assert {parameter.name for parameter in options.PARAMETERS} <= {p.name for p in earthlight.PARAMETERS}
