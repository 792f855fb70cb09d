# SPDX-License-Identifier: Apache-2.0
"""What is shown of an instant, against directions and rotations worked out in another way."""

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from css_common.codec import codec_of
from css_console.frames import Spacecraft, frame_of
from css_msgs.msg import ControlStatus, CssVoltages, Faults, Health, SpacecraftState, SunEstimate, WheelState

STAMP = 1_370_044_800_100_000_000
BEGIN = 1_370_044_800_000_000_000
ROTATION = Rotation.from_euler("zyx", [0.4, -0.9, 1.7])  # turns components in b into n
SUN_N = np.array([0.6, 0.0, 0.8])
CRAFT = Spacecraft((0.0, 0.0, 1.0), "ekf")


def sample(message_type, /, stamp_ns=STAMP, **fields):
    return message_type, codec_of(message_type).sample(stamp_ns, "bus", **fields)


def truth(**fields):
    vector = ROTATION.as_rotvec()
    angle = np.linalg.norm(vector)
    sigma = vector / angle * math.tan(angle / 4.0)
    given = {"sigma_bn": sigma, "sun_n": SUN_N, "r_n": np.array([0.0, 7e6, 0.0]), "illumination": 0.5}
    return sample(SpacecraftState, **{**given, "omega_bn_b": np.array([0.0, 0.01, 0.0]), **fields})


def estimate(tilt_deg=2.0, sigma_deg=1.0, **fields):
    """A Sun that is off by an angle, with the same sigma in both directions across it."""
    sun_b = ROTATION.inv().apply(SUN_N)
    across = np.cross(sun_b, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    tilt = math.radians(tilt_deg)
    off = math.cos(tilt) * sun_b + math.sin(tilt) * across
    covariance = math.radians(sigma_deg) ** 2 * (np.eye(3) - np.outer(off, off))
    given = {"sun_b": off, "covariance": covariance.ravel(), "validity": SunEstimate.VALIDITY_VALID, **fields}
    return sample(SunEstimate, **given)


def shown(**samples):
    frame = frame_of({f"/{name.replace('__', '/')}": s for name, s in samples.items()}, STAMP, BEGIN, CRAFT)
    json.dumps(frame.shown, allow_nan=False)  # as a browser gets it
    assert len(frame.row) == len(frame.series)
    return frame


def test_sun_earth_and_attitude_are_those_of_the_truth():
    now = shown(truth=truth()).shown
    assert now["time"] == pytest.approx(0.1)
    assert Rotation.from_quat(now["q_nb"]).apply(now["sun"]) == pytest.approx(SUN_N)
    assert now["sun"] == pytest.approx(ROTATION.inv().apply(SUN_N))
    assert now["earth"]["b"] == pytest.approx(ROTATION.inv().apply([0.0, -1.0, 0.0]))
    assert math.sin(math.radians(now["earth"]["radius_deg"])) == pytest.approx(6_378_137.0 / 7e6)
    assert now["earth"]["sun_deg"] == pytest.approx(90.0)
    assert now["pointing_deg"] == pytest.approx(math.degrees(math.acos(now["sun"][2])))
    assert now["rate_deg_s"] == pytest.approx([0.0, math.degrees(0.01), 0.0])


@pytest.mark.parametrize("tilt_deg", [0.5, 2.0, 30.0])
def test_error_and_bound_of_an_estimate(tilt_deg):
    frame = shown(truth=truth(), ekf__sun_estimate=estimate(tilt_deg, 1.5))
    (told,) = frame.shown["estimates"]
    assert (told["name"], told["flies"], told["validity"]) == ("ekf", True, "valid")
    assert told["error_deg"] == pytest.approx(tilt_deg)
    assert told["bound_deg"] == pytest.approx(4.5)
    row = dict(zip(frame.series, frame.row, strict=True))
    assert row["heading", "ekf error", "deg"] == pytest.approx(tilt_deg)
    assert row["heading", "ekf 3 sigma", "deg"] == pytest.approx(4.5)


def test_no_error_is_told_of_two_instants_or_of_no_estimate():
    for kind, made in (estimate(stamp_ns=STAMP - 1), estimate(validity=SunEstimate.VALIDITY_NONE)):
        (told,) = shown(truth=truth(), ekf__sun_estimate=(kind, made)).shown["estimates"]
        assert told["error_deg"] is None
    (told,) = shown(ekf__sun_estimate=estimate()).shown["estimates"]
    assert told["error_deg"] is None and told["bound_deg"] is not None  # without truth
    covariance = np.zeros(9)
    covariance[0] = -1.0
    (told,) = shown(truth=truth(), wavg__sun_estimate=estimate(covariance=covariance)).shown["estimates"]
    assert told["bound_deg"] is None and told["error_deg"] == pytest.approx(2.0) and not told["flies"]


def test_masks_modes_wheels_and_readings_that_there_are_not():
    now = shown(
        ekf__sun_estimate=estimate(lit_mask=0b1010, isolated=0b100),
        css__voltages=sample(CssVoltages, voltages=np.array([0.5, np.nan, 0.0]), saturated=0b1),
        wheels__state=sample(WheelState, speed=np.array([100.0 * math.pi, -math.pi])),
        control__status=sample(
            ControlStatus, mode=ControlStatus.MODE_SUN_POINT, reason=ControlStatus.REASON_ON_SUN, pointing_error=-1.0
        ),
    ).shown
    assert (now["estimates"][0]["lit"], now["estimates"][0]["isolated"]) == ([1, 3], [2])
    assert (now["cells"], now["saturated"]) == ([0.5, None, 0.0], [0])
    assert now["wheels_rpm"] == pytest.approx([3000.0, -30.0])
    assert (now["control"]["mode"], now["control"]["reason"], now["control"]["error_deg"]) == ("point", "on sun", None)


def test_faults_and_verdicts_are_said_in_words():
    def column(value):
        return np.array([value], np.uint32)

    units = {"sort": column(Faults.SORT_CELL), "unit": column(3), "kind": column(Faults.KIND_DEAD)}
    now = shown(
        faults__css_array=sample(Faults, **units, rows=np.array([0.0, 0.0, 12.5, -1.0])),
        health__ekf=sample(Health, **units, evidence=column(Health.EVIDENCE_DEAD), rows=np.array([21.0, 20.0, 13.0])),
    ).shown
    assert now["faults"] == ["css_array: cell.3 dead from=12.5"]
    (verdict,) = now["health"]
    assert (verdict["node"], verdict["unit"], verdict["kind"], verdict["since_s"]) == ("ekf", "cell.3", "dead", 13.0)
    assert "nothing" in verdict["evidence"]


def test_of_wheels_what_they_report_is_shown_not_what_is_true():
    true, reported = (sample(WheelState, speed=np.full(3, speed)) for speed in (10.0, 20.0))
    now = shown(truth__wheels=true, wheels__state=reported).shown
    assert now["wheels_rpm"] == pytest.approx([20.0 * 30.0 / math.pi] * 3)
