# SPDX-License-Identifier: Apache-2.0
"""What the flight's own orbit model says, and when nobody is asked."""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from presence import present
from sensor_msgs.msg import Illuminance

from css_common.codec import Sample, codec_of
from css_common.component import Cycles
from css_common.epochs import parse_utc
from css_common.sensor_inputs import FULL_SUN_LUX
from css_environment.earth_light import DISC, DISC_LIGHT
from css_environment.mission_environment import MissionEnvironment
from css_estimation.nodes.ekf import Ekf
from css_estimation.nodes.sun_filter import SunFilter
from css_estimation.sun.flight_sky import flight_sky, sky_at
from css_estimation.sun.sun_heading import (
    PREDICTION_ECLIPSED,
    PREDICTION_SUNLIT,
    PREDICTION_UNKNOWN,
    UNKNOWN_SKY,
)
from css_msgs.msg import CssVoltages

NOON_S, NIGHT_S = 600.0, 4000.0


def values(kind=SunFilter, **changes):
    return okeefe_values(kind.table(), **changes)


def stamp(given, elapsed_s):
    return parse_utc(given.mission.epoch) + round(elapsed_s * 1e9)


@pytest.mark.parametrize(("elapsed_s", "predicted"), [(NOON_S, PREDICTION_SUNLIT), (NIGHT_S, PREDICTION_ECLIPSED)])
def test_sun_and_shadow_are_those_of_the_orbit(elapsed_s, predicted):
    given = values()
    sky = present(flight_sky(given)).at(stamp(given, elapsed_s))
    expected = MissionEnvironment(given, field=False).at(elapsed_s)
    assert sky.known and sky.predicted == predicted
    assert (sky.sun_n, sky.solar_flux, sky.illumination) == (
        expected.sun_n,
        expected.solar_flux,
        expected.illumination,
    )


def test_the_light_is_that_of_the_earth_which_the_filter_expects():
    bright, dark = values(albedo__factor=2.0), values(albedo__reflectivity="constant", albedo__constant=0.0)
    usual = values()
    light = {
        name: present(flight_sky(v)).at(stamp(v, NOON_S)).light
        for name, v in (("2", bright), ("0", dark), ("1", usual))
    }
    assert light["1"][DISC + DISC_LIGHT] > 0.05
    # reflectivities above a half of which the double is cut to one lie at the poles, out of sight here
    assert light["2"][DISC + DISC_LIGHT] == pytest.approx(2.0 * light["1"][DISC + DISC_LIGHT], rel=0.02)
    assert light["0"][DISC + DISC_LIGHT] == 0.0


def test_who_asks_for_nothing_is_told_nothing():
    for given in (values(use_orbit=False), values(orbit__source="none"), values(Ekf)):
        assert flight_sky(given) is None
        assert sky_at(flight_sky(given), stamp(given, 0.0)) is UNKNOWN_SKY
    assert UNKNOWN_SKY.predicted == PREDICTION_UNKNOWN and not np.any(UNKNOWN_SKY.light)


def test_an_estimator_that_knows_no_earth_may_ask_for_the_shadow_alone():
    given = values(Ekf, eclipse__source="both")
    sky = present(flight_sky(given)).at(stamp(given, NIGHT_S))
    assert sky.predicted == PREDICTION_ECLIPSED and not np.any(sky.light)


def test_a_flag_of_the_spacecraft_has_the_word_on_the_shadow_and_without_it_the_cells_have():
    """Bright cells in a shadow that the spacecraft reports, without any orbit."""
    given = values(Ekf, eclipse__source="flag", use_gyro=False, health__enabled=False)
    (heard,) = (i for i in Ekf.inputs("ekf", given) if i.key == "sunlight")
    assert heard.topic == "sunlight/illuminance" and heard.held_s > 0.0 and not heard.required
    component = Ekf("ekf", given)
    told = []
    for k, lux in enumerate((None, FULL_SUN_LUX, 0.0, 0.4 * FULL_SUN_LUX, None)):
        stamp_ns = component.epoch_ns + k * component.period_ns
        cells = codec_of(CssVoltages).sample(stamp_ns, "bus", voltages=np.full(8, 0.5))
        flag = None if lux is None else codec_of(Illuminance).sample(stamp_ns, "bus", illuminance=lux)
        estimate = component.cycle(stamp_ns, {"cells": cells, "sunlight": flag})["estimate"]
        assert isinstance(estimate, Sample)
        told.append(estimate.eclipse)
    assert told == [0, 0, 1, 1, 0]
    assert component.cycle_through(Cycles(np.array([0]), {}, {})) is None
