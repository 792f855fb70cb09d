# SPDX-License-Identifier: Apache-2.0
"""A tumbling spacecraft with Gaussian sensors, in plain Python, for tests of the attitude filter."""

import numpy as np
from okeefe_spacecraft import okeefe_values
from presence import present
from scipy.spatial.transform import Rotation

from css_common.attitude import mrp_to_dcm
from css_common.kernel import typed_call
from css_estimation.attitude import attitude_ekf, attitude_options, attitude_solution, flight_references
from css_estimation.attitude.flight_references import References
from css_sensors.cells import CELLS

FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
TABLE = CELLS + attitude_options.PARAMETERS + flight_references.PARAMETERS
NO_LIGHT = np.zeros(192, np.float32)
SUN_N = (0.6, 0.0, 0.8)
_step = typed_call(attitude_ekf.step)


def options(normals=FACES, **changes):
    """Parameters of a filter for cells of half the sky."""
    return attitude_options.parameters(
        okeefe_values(
            TABLE,
            cells__normals=np.asarray(normals, dtype=float).ravel().tolist(),
            cells__field_of_view_deg=180.0,
            cells__clip_normal=[0.0, 0.0, 0.0],
            **changes,
        )
    )


class Scene:
    """Truth and sensors: the noise of `attitude_options`' defaults, one step a second."""

    def __init__(self, seed, *, normals=FACES, scales=1.0, steps=2000, noise=1.0):
        self.rng = np.random.default_rng(seed)
        self.normals, self.scales, self.noise = np.asarray(normals), scales, noise
        self.attitude = Rotation.random(random_state=self.rng)  # from n to b
        self.omega = np.radians(self.rng.uniform(-2.0, 2.0, 3))
        self.bias = np.radians(0.08) * self.rng.normal(size=3) * noise
        self.k = 0

    def advance(self, seconds=1.0):
        """The body turns on, its rate slowly turning too."""
        steps = max(1, round(4 * seconds))
        for _ in range(steps):
            h = seconds / steps
            self.omega = self.omega + h * 0.01 * np.cross([0.3, -0.2, 1.0], self.omega)
            self.attitude = Rotation.from_rotvec(-h * self.omega) * self.attitude
        self.k += seconds

    @property
    def sun_b(self):
        return self.attitude.apply(SUN_N)

    @property
    def field_n(self):
        """Turns as along an orbit."""
        a = 2.2e-3 * self.k + 1.0
        return 3e-5 * np.array([np.cos(a), 0.4 * np.sin(a), -np.sin(a)])

    def references(self, sunlit=True):
        return References(SUN_N, 1.0 if sunlit else 0.0, sunlit, tuple(self.field_n.tolist()))

    def voltages(self):
        exact = self.scales * np.maximum(self.normals @ self.sun_b, 0.0)
        return exact + 0.02 * self.noise * self.rng.normal(size=len(self.normals))

    def gyro(self):
        return tuple(self.omega + self.bias + np.radians(0.03) * self.noise * self.rng.normal(size=3))

    def field(self):
        return tuple(self.attitude.apply(self.field_n) + 200e-9 * self.noise * self.rng.normal(size=3))


def guess(scene, error_deg):
    """MRP of an attitude that is off by so much about each axis, 1 sigma."""
    off = Rotation.from_rotvec(np.radians(error_deg) * scene.rng.normal(size=3)) * scene.attitude
    # A(q) = dcm_bn is the inverse of the rotation that moves vectors
    x, y, z, w = off.inv().as_quat(canonical=True)
    return tuple(float(c / (1.0 + w)) for c in (x, y, z))


class Run:
    """One filter on a scene."""

    def __init__(self, p):
        self.p = p
        self.state, self.memory = attitude_solution.initial_state(p), attitude_solution.initial_memory(p)
        self.solution = None

    def step(self, scene, dt=1.0, *, voltages=None, gyro=None, field=None, sunlit=True, references=None, valid=True):
        """One cycle on the scene's data, or on what is given in its place."""
        self.state, self.solution = _step(
            self.p,
            self.state,
            self.memory,
            dt,
            scene.voltages() if voltages is None else voltages,
            scene.gyro() if gyro is None else gyro,
            valid,
            scene.field() if field is None else field,
            valid,
            scene.references(sunlit) if references is None else references,
            NO_LIGHT,
        )
        self.check()
        return self.solution

    def check(self):
        """Whatever came in, what goes out is sane."""
        s, p = present(self.solution), self.memory.covariance
        assert np.isfinite([*s.sigma_bn, *s.omega_bn_b, *s.bias_b, s.age, s.nis]).all()
        assert np.linalg.norm(s.sigma_bn) <= 1.0 + 1e-9
        assert np.isfinite(p).all() and np.array_equal(p, p.T)
        scale = np.sqrt(np.diag(p))
        assert np.linalg.eigvalsh(p / np.outer(scale, scale)).min() > -1e-9
        assert (np.diag(p) <= self.memory.largest * (1.0 + 1e-9)).all()

    @property
    def sigma_deg(self):
        """Standard deviation of the attitude error by the filter, all axes together."""
        return float(np.degrees(np.sqrt(np.trace(self.memory.covariance[:3, :3]))))

    def error_deg(self, scene):
        estimated = Rotation.from_matrix(np.array(mrp_to_dcm(present(self.solution).sigma_bn)))
        return float(np.degrees((scene.attitude * estimated.inv()).magnitude()))

    def heading_error_deg(self, scene):
        """Angle of estimated to true Sun."""
        sun_b = np.array(mrp_to_dcm(present(self.solution).sigma_bn)) @ SUN_N
        return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(sun_b, scene.sun_b)), sun_b @ scene.sun_b)))

    def nees(self, scene):
        """Attitude error squared, normalised by the filter's covariance: 3 in the mean of a consistent filter."""
        estimated = Rotation.from_matrix(np.array(mrp_to_dcm(present(self.solution).sigma_bn)))
        # of frames, b true relative to b estimated
        turn = -(scene.attitude * estimated.inv()).as_rotvec()
        return float(turn @ np.linalg.solve(self.memory.covariance[:3, :3], turn))
