# SPDX-License-Identifier: Apache-2.0
"""Outputs that fade together are a Sun that sets: the heading is held, and no rate is made of it."""

import math

import numpy as np
import pytest
from listing import components, executable
from okeefe_spacecraft import okeefe_values

from css_common.attitude import rotation_vector_to_dcm
from css_common.vectors import multiply, scale
from css_estimation.sun import fading
from css_estimation.sun.cell_layout import cell_layout
from css_estimation.sun.fading import KNOWN_TURN, LightNow, follow_light, in_the_dark, initial_track
from css_estimation.sun.sun_estimator import SunEstimator
from css_estimation.sun.sun_heading import (
    PREDICTION_ECLIPSED,
    PREDICTION_SUNLIT,
    RATE_NONE,
    UNAIDED,
    VALIDITY_HELD,
    VALIDITY_VALID,
)
from css_estimation.sun_filter import sun_filter

DT = 0.1
PENUMBRA = 80  # cycles, as in low orbit
NORMALS = np.asarray(okeefe_values([p for k in components(base=SunEstimator) for p in k.table()]).cells.normals)
# those for flat faces know the shadow by their orbit model, and no scale of the outputs turns their heading; the Sun
# filter, which knows what every cell should read, has a dusk and tests of its own
KINDS = [
    kind
    for kind in components(base=SunEstimator)
    if issubclass(kind, SunEstimator)
    and kind.algorithm is not sun_filter
    and not list(kind.conflicts(okeefe_values(kind.table())))
]
GYRO = pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])


def outputs_of(sun_b, part=1.0):
    """Eight cells with a part of the Sun, and a little light of the Earth on four of them."""
    cosines = NORMALS @ sun_b
    direct = np.where((cosines >= 0.5) & (NORMALS[:, 2] * sun_b[2] > 0.0), cosines, 0.0)
    return part * direct + 0.02 * np.maximum(NORMALS @ (0.6, 0.0, 0.8), 0.0)


def aiding(gyro, part=1.0):
    shadow = PREDICTION_ECLIPSED if part < 0.5 else PREDICTION_SUNLIT
    return UNAIDED._replace(gyro_valid=gyro, sky=UNAIDED.sky._replace(predicted=shadow))


def angle_deg(a, b):
    return math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))


class Estimator:
    def __init__(self, kind, **changes):
        self.algorithm = kind.algorithm
        self.p = kind.algorithm.parameters(okeefe_values(kind.table(), **changes))
        self.state = kind.algorithm.initial_state(self.p)
        self.memory = kind.algorithm.initial_memory(self.p)

    def step(self, voltages, given):
        self.state, heading = self.algorithm.step(self.p, self.state, self.memory, DT, voltages, given)
        return heading


@GYRO
@pytest.mark.parametrize("kind", KINDS, ids=executable)
def test_dusk_is_no_turn(kind, gyro):
    """At rest, 12 deg off the array normal, the Sun sets within 8 s; a minute later the heading is what it was."""
    sun_b = np.array([math.sin(math.radians(12.0)), 0.0, math.cos(math.radians(12.0))])
    estimator = Estimator(kind)
    for _ in range(600):
        before = estimator.step(outputs_of(sun_b), aiding(gyro))
    assert before.validity == VALIDITY_VALID
    for k in range(PENUMBRA + 600):
        part = max(0.0, 1.0 - k / PENUMBRA)
        heading = estimator.step(part * outputs_of(sun_b) + (1.0 - part) * 0.01, aiding(gyro, part))
    assert heading.validity == VALIDITY_HELD
    # a tenth of the light is gone before it is noticed: no more than that of a cell is a direction
    assert angle_deg(heading.sun_b, before.sun_b) < math.degrees(0.05)
    assert np.degrees(np.linalg.norm(heading.omega_bn_b)) < 0.05
    if not gyro:
        assert heading.rate_source == RATE_NONE
        # nothing is known of the motion since: the error bar has grown, or there is none
        assert heading.covariance[0] < 0.0 or sum(heading.covariance[::4]) > sum(before.covariance[::4])


@GYRO
@pytest.mark.parametrize("kind", KINDS, ids=executable)
def test_a_turn_is_no_dusk(kind, gyro):
    """Through the views of all cells at 2 deg/s: as long as there is light there is a heading."""
    estimator = Estimator(kind)
    omega = tuple(math.radians(2.0) * np.array([0.6, 0.64, 0.48]))
    dcm = rotation_vector_to_dcm(scale(DT, omega))
    sun_b, held = (0.0, 0.28, 0.96), 0
    for k in range(1800):
        sun_b = multiply(dcm, sun_b)
        given = aiding(gyro)._replace(gyro_b=omega if gyro else (0.0, 0.0, 0.0))
        heading = estimator.step(outputs_of(np.array(sun_b)), given)
        held += k > 10 and heading.validity != VALIDITY_VALID
    assert held <= 18, "a cycle in a hundred"


@pytest.mark.parametrize("kind", [k for k in KINDS if executable(k) in ("wavg", "wls", "ekf")], ids=executable)
def test_an_orbit_model_that_has_the_word_says_where_the_penumbra_is(kind):
    """At dusk and at dawn: half of the Sun's disc is no light to take a direction from."""
    sun_b = np.array([0.2, 0.0, math.sqrt(0.96)])
    estimator = Estimator(kind, eclipse__source="model")
    for part, validity in ((1.0, VALIDITY_VALID), (0.7, VALIDITY_HELD), (1.0, VALIDITY_VALID)):
        given = aiding(True)
        given = given._replace(sky=given.sky._replace(known=True, illumination=part))
        for _ in range(3):
            heading = estimator.step(outputs_of(sun_b, part), given)
        assert heading.validity == validity


def followed(lights, track=None, share=KNOWN_TURN):
    track, fades = track or initial_track(), []
    for light in lights:
        track, fading_now = follow_light(track, DT, LightNow(light, share))
        fades.append(fading_now)
    return track, np.array(fades)


STEADY = [1.0] * 150


def test_light_that_goes_in_seconds_fades_until_it_is_back_or_gone():
    falling = np.linspace(1.0, 0.05, PENUMBRA)
    track, fades = followed([*STEADY, *falling])
    first = np.argmax(fades) - len(STEADY)
    assert 0.83 < falling[first] < 0.9, "a tenth of what it was in the last seconds"
    assert fades[len(STEADY) + first :].all()
    assert not followed([1.0], track)[1].any()
    dark = in_the_dark(track, False)
    assert dark.before > 0.9 and in_the_dark(track, True).before == 0.0
    assert not followed(STEADY, dark)[1].any()


def test_light_that_goes_in_a_minute_or_in_one_step_does_not_fade():
    assert not followed([*STEADY, *np.linspace(1.0, 0.5, 600)])[1].any()
    assert not followed([*STEADY, *[0.5] * 100])[1].any()


def test_another_light_that_lasts_is_another_intensity():
    _, fades = followed([*STEADY, *[0.8] * 400])
    assert fades[len(STEADY) + 10] and not fades[-1]
    assert np.count_nonzero(fades) == pytest.approx(150, abs=2)


def test_light_on_the_cells_is_that_of_the_cell_that_faded_least():
    layout = cell_layout(okeefe_values(KINDS[0].table()))
    sun_b = np.array([0.2, 0.0, math.sqrt(0.96)])
    voltages = 0.9 * outputs_of(sun_b)
    voltages[1] = math.nan
    mask = fading.cells_that_see(layout, tuple(sun_b))
    assert mask == 0b1111
    expected = max(voltages[i] / (NORMALS[i] @ sun_b) for i in (0, 2, 3))
    assert fading.light_on(layout, tuple(sun_b), voltages, mask) == pytest.approx(expected, rel=1e-12)
    assert fading.light_on(layout, tuple(sun_b), voltages, 0) == 0.0
