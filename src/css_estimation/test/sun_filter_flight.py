# SPDX-License-Identifier: Apache-2.0
"""A rigid body that turns freely under a fixed Sun, a Sun filter on board: for tests of the filter alone."""

import numpy as np
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.matrices import IDENTITY
from css_common.vectors import angle_between, matmul, multiply, unit
from css_environment.albedo import albedo_output, new_workspace
from css_environment.earth_light import albedo_sources, new_earth_view, new_light
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun.sun_heading import UNAIDED, UNKNOWN_SKY
from css_estimation.sun_filter import sun_filter

DT = 0.1


def outputs_of(p, sun_b):
    """What calibrated cells read of the Sun alone."""
    normals = np.column_stack([p.cells["nx"], p.cells["ny"], p.cells["nz"]])
    cosines = normals @ np.asarray(sun_b)
    seen = cosines >= p.cos_half_view
    above = p.cells["side"] * np.dot(p.screen.axis_b, sun_b)
    return np.where(seen & ((p.cells["side"] == 0.0) | (above > 0.0)), np.maximum(cosines, 0.0), 0.0)


class SunFilterFlight:
    """Cells of a layout on a body; `step` flies one cycle and gives what the algorithm makes of it."""

    algorithm = sun_filter

    def __init__(self, sun_b=(0.0, 0.6, 0.8), omega=(0.0, 0.0, 0.0), seed=1, white=0.0, earth=None, **changes):
        self.p = self.algorithm.parameters(okeefe_values(SunFilter.table(), **changes))
        self.filter = getattr(self.p, "filter", self.p)  # of what carries one
        self.state = self.algorithm.initial_state(self.p)
        self.memory = self.algorithm.initial_memory(self.p)
        self.sun_n = unit((1.0, 0.0, 0.0))
        self.dcm_bn = _onto(unit(sun_b), self.sun_n)
        self.momentum_n = multiply(_transposed(self.dcm_bn), multiply(self.filter.motion.inertia, omega))
        self.wheels_b = np.zeros(3)
        self.dice = np.random.default_rng(seed)
        self.white = white
        self.light = new_light()
        self.sky = UNKNOWN_SKY
        self.field_n = None
        if earth is not None:
            r_n = tuple(6.778e6 * np.asarray(unit(earth)))
            albedo_sources(new_earth_view(), r_n, self.sun_n, 1.0, IDENTITY, np.full((36, 72), 0.3), self.light)
            self.sky = UNKNOWN_SKY._replace(known=True, sun_n=self.sun_n, light=self.light)

    @property
    def sun_b(self):
        """The true direction."""
        return multiply(self.dcm_bn, self.sun_n)

    @property
    def omega(self):
        """The true rate."""
        momentum_b = np.array(multiply(self.dcm_bn, self.momentum_n)) - self.wheels_b
        return multiply(self.filter.motion.inverse_inertia, tuple(momentum_b))

    def voltages(self, part=1.0):
        """Outputs of this cycle, with part of the Sun's disc in view."""
        outputs = part * outputs_of(self.filter, self.sun_b)
        if self.sky.known:
            albedo, p = np.zeros(len(outputs)), self.filter
            albedo_output(self.light, p.cells, p.screen, p.cos_half_view, self.dcm_bn, new_workspace(), albedo)
            outputs = outputs + part * albedo
        return outputs + self.white * self.dice.normal(size=len(outputs))

    def step(self, *, gyro=False, part=1.0, predicted=None, wheels=True, change=None):
        """One cycle; `predicted` is the part of the Sun's disc by the orbit, `change` is done to the outputs."""
        omega = np.array(self.omega)
        for _ in range(4):
            middle = matmul(rotation_vector_to_dcm(tuple(0.125 * DT * omega)), self.dcm_bn)
            momentum_b = np.array(multiply(middle, self.momentum_n)) - self.wheels_b
            omega = np.array(multiply(self.filter.motion.inverse_inertia, tuple(momentum_b)))
            self.dcm_bn = matmul(rotation_vector_to_dcm(tuple(0.25 * DT * omega)), self.dcm_bn)
        voltages = self.voltages(part)
        if change is not None:
            change(voltages)
        axes = np.column_stack([self.filter.motion.wheels[name] for name in ("hx", "hy", "hz")])
        aiding = UNAIDED._replace(
            gyro_b=self.omega,
            gyro_valid=gyro,
            wheel_speeds=np.linalg.lstsq(axes.T, self.wheels_b, rcond=None)[0],
            wheels_valid=wheels,
            sky=self.sky._replace(illumination=part if predicted is None else predicted),
        )
        if self.field_n is not None:
            aiding = aiding._replace(
                field_b=multiply(self.dcm_bn, self.field_n),
                field_valid=True,
                sky=aiding.sky._replace(field_n=self.field_n),
            )
        self.state, result = self.algorithm.step(self.p, self.state, self.memory, DT, voltages, aiding)
        return result

    def fly(self, seconds, **conditions):
        """The last result after some seconds."""
        result = None
        for _ in range(round(seconds / DT)):
            result = self.step(**conditions)
        return result

    def error_deg(self, heading):
        """Error of a heading."""
        return float(np.degrees(angle_between(heading.sun_b, self.sun_b)))

    def squared_error(self, heading):
        """The error normalised by its covariance, squared: chi-square of the two axes across the Sun line."""
        error = np.subtract(heading.sun_b, self.sun_b)
        across = np.linalg.svd(np.array([self.sun_b]))[2][1:]
        covariance = across @ np.reshape(heading.covariance, (3, 3)) @ across.T
        return float(across @ error @ np.linalg.solve(covariance, across @ error))


def _transposed(m):
    return tuple(zip(*m, strict=True))


def _onto(sun_b, sun_n):
    axis = np.cross(sun_n, sun_b)
    sine, cosine = np.linalg.norm(axis), float(np.dot(sun_n, sun_b))
    if sine < 1e-12:
        return IDENTITY if cosine > 0.0 else ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
    return rotation_vector_to_dcm(tuple(-np.arctan2(sine, cosine) * axis / sine))
