# SPDX-License-Identifier: Apache-2.0
"""A Sun line that the gyro leads fits the cells while the gyro is right, whatever edges of views the Sun crosses."""

import math

import numpy as np
import pytest
from ideal_cells import ideal_outputs
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.declared import builder
from css_common.vectors import unit, vector_of
from css_estimation.health.cell_options import CellHealthParameters
from css_estimation.health.gyroless_sight import (
    Glimpse,
    contradicts,
    follow_gyro,
    gyro_led_parameters,
    gyroless_parameters,
    initial_led,
    initial_state,
    look,
)
from css_estimation.health.rate_checks import RateChecks
from css_estimation.nodes.ekf import Ekf
from css_estimation.sun.sun_heading import UNKNOWN_SKY

DT, LARGEST = 0.1, 2.0
NO_SPEEDS = np.zeros(0)
NO_GLIMPSE = Glimpse((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), False)


class Turning:
    """A body that turns evenly under the Sun and an Earth that lights the cells on the other side, and what follows."""

    def __init__(self, sun_b, omega, off_deg, earth):
        values = okeefe_values(Ekf.table())
        self.p, self.cells = gyro_led_parameters(values), builder(CellHealthParameters)(values)
        self.sun_b, self.omega, self.earth = np.array(unit(sun_b)), np.array(omega), earth
        self.led = initial_led(self.p)
        self.contradicted = False
        side = np.cross(self.sun_b, unit((0.3, -0.5, 0.8)))
        begun = self.sun_b + math.tan(math.radians(off_deg)) * side / np.linalg.norm(side)
        variance = math.radians(4.0) ** 2
        seen = Glimpse(unit(tuple(begun)), (variance, 0.0, 0.0, variance, 0.0, variance), True)
        while self.led.since < 0.0:
            self._follow(self.omega, seen)

    def _follow(self, gyro_b, glimpse):
        layout = self.p.layout
        outputs = np.zeros(len(layout.cells))
        ideal_outputs(layout, tuple(self.sun_b), False, 1.0, outputs)
        outputs[outputs == 0.0] = self.earth
        gyro = vector_of(np.asarray(gyro_b, float))
        self.led = follow_gyro(
            self.p, self.cells, self.led, DT, outputs, NO_SPEEDS, UNKNOWN_SKY, gyro, True, glimpse, LARGEST, 0.0
        )

    def fly(self, seconds, error=(0.0, 0.0, 0.0)):
        """Flies on; the largest misfit meanwhile."""
        worst = 0.0
        turn = np.array(rotation_vector_to_dcm(tuple(DT * self.omega)))
        for _ in range(round(seconds / DT)):
            self.sun_b = turn @ self.sun_b
            self._follow(self.omega + error, NO_GLIMPSE)
            worst = max(worst, self.led.misfit)
            self.contradicted |= contradicts(self.led)
        return worst

    @property
    def error_deg(self):
        sun_b = self.led.filter.tracking.sun_b
        return math.degrees(math.atan2(np.linalg.norm(np.cross(sun_b, self.sun_b)), np.dot(sun_b, self.sun_b)))


def skies(count):
    return np.random.default_rng(11).normal(size=(count, 2, 3))


@pytest.mark.parametrize("earth", [0.0, 0.28])
def test_a_right_gyro_is_not_contradicted_at_edges_of_views(earth):
    for sun_b, axis in skies(12):
        flight = Turning(tuple(sun_b), math.radians(4.0) * axis / np.linalg.norm(axis), 2.5, earth)
        flight.fly(15.0)  # a cell on an edge may put it off at its beginning
        assert flight.fly(90.0) < LARGEST and not flight.contradicted
        assert flight.error_deg < 5.0


def test_a_gyro_that_lies_is_contradicted():
    for sun_b, axis in skies(12):
        across = np.cross(sun_b, axis)
        flight = Turning(tuple(sun_b), math.radians(1.0) * axis / np.linalg.norm(axis), 2.5, 0.1)
        flight.fly(20.0)
        assert not flight.contradicted
        flight.fly(60.0, error=math.radians(3.0) * across / np.linalg.norm(across))
        assert flight.contradicted


FACES = np.vstack([np.eye(3), -np.eye(3)])


@pytest.mark.parametrize("missing", [(), (5,), (3, 4, 5)], ids=["six faces", "five", "three"])
def test_a_sight_without_gyro_that_is_known_is_right_also_where_no_cell_looks(missing):
    """A dark cell is one at 90 deg from the Sun only where the one behind it would be lit beyond."""
    normals = np.delete(FACES, missing, axis=0)
    cells = {"cells__normals": normals.ravel().tolist(), "cells__field_of_view_deg": 180.0}
    values = okeefe_values(Ekf.table(), **cells, cells__clip_normal=[0.0, 0.0, 0.0])
    p, checks = gyroless_parameters(values), builder(RateChecks)(values)
    state, shown, worst, outputs = initial_state(p), 0, 0.0, np.zeros(len(normals))
    sun_b, turn = np.array(unit((0.5, 0.6, 0.6))), np.array(rotation_vector_to_dcm((0.001, -0.0015, 0.002)))
    for _ in range(8000):
        sun_b = turn @ sun_b
        ideal_outputs(p.layout, tuple(sun_b), False, 1.0, outputs)
        told = tuple(sun_b.tolist())
        state, sight = look(p, checks, state, DT, outputs, NO_SPEEDS, UNKNOWN_SKY, outputs.max() > 0.1, told)
        if sight.known:
            shown += 1
            worst = max(worst, math.degrees(math.acos(min(1.0, float(sun_b @ sight.sun_b)))))
    assert shown > 500
    assert worst < 10.0
