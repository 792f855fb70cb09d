# SPDX-License-Identifier: Apache-2.0
"""Attitudes of a spinning payload by TRIAD in many cases, against the truth and against their own covariance.

A case draws roll and coning phase, noise, the time in the last steady phase and the elevation of the spin axis, which
sets the Sun angle. It watches the payload for some seconds and takes the last attitude. Sensors and estimates are the
functions that fly.
"""

import copy
from typing import NamedTuple

import numpy as np

from css_common.attitude import dcm_to_mrp, mrp_to_rotation_vector
from css_common.mission import Mission
from css_common.random_streams import RandomKey, Stream, random_key, uniform4
from css_common.schema import Values
from css_common.vectors import Vec3, mat3, multiply
from css_environment.mission_environment import MissionEnvironment
from css_estimation.attitude.sun_field_attitude import (
    MODE_NONE,
    ORDER_BEST,
    interpolated_field,
    interpolated_variance,
    sun_field_attitude,
)
from css_estimation.spin import slit_measurement
from css_estimation.spin.slit_record import SlitRecord, read_record
from css_sensors.slits import SLITS_PER_HEAD, TIMER_SPAN, head_azimuths
from css_sim import magnetometer, slit_timer
from css_sim.fault_effects import NO_FAULTS
from css_sim.slit_crossings import slit_crossings, slit_geometry
from css_sim.spinning_payload import PayloadMotion, payload_motion, payload_state

WATCHED = 12.0
"""Time [s] of pulses before the attitude of a case: the swing of the Sun angle is known by then."""

AXIS_ELEVATIONS_DEG = (45.0, 85.0)
"""Range of the spin axis: mean Sun angles between about -8 and 30 deg for the launch of `esprit_2006`."""


class AttitudeCases(NamedTuple):
    """N cases; those that gave no attitude are left out."""

    case: np.ndarray  # (N,) numbers
    error: np.ndarray  # (N, 3) [rad] rotation vector in b from estimated to true attitude
    nees: np.ndarray  # (N,) normalised estimation error squared, chi-square with 3 degrees of freedom
    nis: np.ndarray  # (N,) of the angle between the directions, one degree of freedom
    sun_angle: np.ndarray  # (N,) [rad]


def attitude_cases(mission: Mission, cases: int) -> AttitudeCases:
    """Attitudes of the cases 0 to `cases` - 1 of a mission with a slit sensor and a magnetometer."""
    sensor, estimator = mission.node("slit_sensor").values, mission.node("slit_sun_angle").values
    field_sensor = mission.node("magnetometer").values
    environment = MissionEnvironment(sensor, field=True)
    rows = []
    for case in range(cases):
        key = random_key(mission.values.mission.seed, case)
        chance = uniform4(key, Stream.SPIN_PHASE, 1, 0)
        values = copy.deepcopy(sensor)
        low, high = AXIS_ELEVATIONS_DEG
        values.payload.axis_elevation_deg = low + (high - low) * chance[0]
        motion = payload_motion(values, mission.epoch_ns, key)
        start = values.payload.phase_starts[-1]
        end = start + WATCHED + (values.payload.flat_spin_start - start - WATCHED) * chance[1]
        record = _watched(values, estimator, motion, key, environment.at(end).sun_n, end)
        if len(record.passages.time):
            result = _attitude(record, motion, key, environment, field_sensor, mission.values.mission.period)
            if result is not None:
                rows.append((case, *result, record.passages.angle[-1]))
    columns = np.array(rows).reshape(-1, 7).T
    return AttitudeCases(columns[0].astype(np.int64), columns[1:4].T, columns[4], columns[5], columns[6])


def _watched(
    values: Values, estimator: Values, motion: PayloadMotion, key: RandomKey, sun_n: Vec3, end: float
) -> SlitRecord:
    """Passages of the last seconds before `end` [s]."""
    azimuths = head_azimuths(values)
    room = int(WATCHED * (motion.fastest / (2.0 * np.pi) + 1.0)) * SLITS_PER_HEAD * len(azimuths)
    times, slits, heads = np.zeros(room), np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
    count = slit_crossings(motion, slit_geometry(values), sun_n, end - WATCHED, end, times, slits, heads)
    ticks, codes = np.zeros(2 * room, dtype=np.int64), np.zeros((2 * room, 2), dtype=np.int64)
    pulses = slit_timer.read_pulses(slit_timer.parameters(values), key, 0, count, times, slits, heads, ticks, codes)
    read_out = zip(ticks[:pulses].tolist(), codes[:pulses].tolist(), strict=True)
    given = [(slit, tick % TIMER_SPAN, head) for tick, (slit, head) in read_out]
    return read_record(slit_measurement.parameters(estimator), given, azimuths)


def _attitude(
    record: SlitRecord,
    motion: PayloadMotion,
    key: RandomKey,
    environment: MissionEnvironment,
    field_sensor: Values,
    period: float,
) -> tuple[float, float, float, float, float] | None:
    """Error vector [rad], NEES and NIS of the attitude at the last passage."""
    p = magnetometer.parameters(field_sensor)
    bias_b = magnetometer.draw_bias(p, key)
    spacing = period * field_sensor.magnetometer.divider
    time = float(record.passages.time[-1])
    first = int(np.ceil(time / spacing)) - 2
    samples = []
    for k in range(first, first + 4):
        field_n = environment.at(k * spacing).field_n
        field_b = multiply(payload_state(motion, k * spacing).dcm_bn, field_n)
        samples.append(magnetometer.measure(p, bias_b, NO_FAULTS, key, k, field_b))
    u = time / spacing - (first + 1)
    before, left, right, after = samples
    field = interpolated_field(before, left, right, after, u)
    rate = float(record.passages.rate[-1])
    variance = interpolated_variance(magnetometer.variance(p), float(np.linalg.norm(field)), rate * spacing, u)
    at = environment.at(time)
    attitude = sun_field_attitude(
        tuple(record.sun_b[-1].tolist()), tuple(record.covariance[-1].tolist()), field, variance, at.sun_n,
        at.field_n, ORDER_BEST,
    )  # fmt: skip
    if attitude.mode == MODE_NONE:
        return None
    error = attitude_error(np.array(attitude.dcm_bn), np.array(payload_state(motion, time).dcm_bn))
    xx, xy, xz, yy, yz, zz = attitude.covariance
    nees = error @ np.linalg.solve([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], error)
    return *error.tolist(), float(nees), attitude.nis


def attitude_error(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """(3,) rotation vector in b [rad] from an estimated to the true dcm_bn."""
    return np.array(mrp_to_rotation_vector(dcm_to_mrp(mat3(true @ estimated.T))))
