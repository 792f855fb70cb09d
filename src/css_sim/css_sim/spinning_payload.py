# SPDX-License-Identifier: Apache-2.0
"""Torque-free motion of a spinning, coning, axisymmetric payload, in phases between deployments.

In each phase the angular momentum h stands still and the spin axis k goes round it at a constant angle: with 3-1-3
angles from a frame along h, precession phi and spin psi grow at constant rates (Wertz, Spacecraft Attitude
Determination and Control, section 16.1). A deployment is sudden: the attitude goes on, the rate jumps, and h turns
about the body's own axes to the new angle from k. At the end of the flight the cone opens into a flat spin.

Motion is a closed form in time: nothing is integrated, and any instant can be asked for.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.kernel import kernel
from css_common.random_streams import RandomKey, Stream, uniform4
from css_common.schema import Values
from css_common.vectors import Mat3, Vec3, matmul, transpose
from css_environment.ballistic import local_direction_n
from css_environment.mission_environment import mission_launch
from css_sensors.payload import (
    AXIS_AZIMUTH,
    AXIS_ELEVATION,
    CONING_ANGLE,
    CONING_PERIOD,
    FINAL_CONING_PERIOD,
    FLAT_SPIN_ANGLE,
    FLAT_SPIN_RATE,
    FLAT_SPIN_START,
    PHASE_STARTS,
    SPIN,
)

_FULL_TURN = 2.0 * math.pi


class PayloadMotion(NamedTuple):
    """Motion of one case in P phases; angles in radians, times in seconds after the epoch."""

    start: np.ndarray  # (P,)
    precession: np.ndarray  # (P, 3) phi at the start, its rate, its acceleration
    nutation: np.ndarray  # (P, 3) theta at the start, its rate, its largest value
    spin: np.ndarray  # (P, 2) psi at the start, its rate there
    dcm_hn: np.ndarray  # (P, 9) rows of the rotation from n to the frame h, whose z is the angular momentum
    fastest: float  # [rad/s] bound of the body rate


class PayloadState(NamedTuple):
    """Attitude and body rate at one instant."""

    dcm_bn: Mat3
    omega_bn_b: Vec3  # [rad/s]


@kernel
def euler_313_dcm(phi: float, theta: float, psi: float) -> Mat3:
    """Rotation by 3-1-3 angles: about z by phi, about the new x by theta, about the new z by psi."""
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    ss, cs = math.sin(psi), math.cos(psi)
    return (
        (cs * cf - ss * ct * sf, cs * sf + ss * ct * cf, ss * st),
        (-ss * cf - cs * ct * sf, -ss * sf + cs * ct * cf, cs * st),
        (st * sf, -st * cf, ct),
    )


@kernel
def payload_state(motion: PayloadMotion, time: float) -> PayloadState:
    """Attitude and body rate at a time [s after the epoch]; at the start of a phase, those of the new phase."""
    i = 0
    while i + 1 < motion.start.shape[0] and motion.start[i + 1] <= time:
        i += 1
    t = time - motion.start[i]
    phi_rate = motion.precession[i, 1] + motion.precession[i, 2] * t
    phi = motion.precession[i, 0] + (motion.precession[i, 1] + 0.5 * motion.precession[i, 2] * t) * t
    theta_0, theta_rate, theta_end = motion.nutation[i, 0], motion.nutation[i, 1], motion.nutation[i, 2]
    psi_rate = motion.spin[i, 1]
    if theta_rate > 0.0:
        # h and both moments of inertia stay, so the axial rate goes with the cosine of the angle
        opening = min(t, (theta_end - theta_0) / theta_rate)
        theta = theta_0 + theta_rate * opening
        per_cosine = psi_rate / math.cos(theta_0)
        psi = motion.spin[i, 0] + per_cosine * (
            (math.sin(theta) - math.sin(theta_0)) / theta_rate + math.cos(theta) * (t - opening)
        )
        psi_rate = per_cosine * math.cos(theta)
        if opening < t:
            theta_rate = 0.0
    else:
        # a drift of the coning at a constant rate of turns relative to the Sun
        theta = theta_0
        psi = motion.spin[i, 0] + (psi_rate - 0.5 * motion.precession[i, 2] * t) * t
        psi_rate -= motion.precession[i, 2] * t
    c = motion.dcm_hn
    dcm_hn = ((c[i, 0], c[i, 1], c[i, 2]), (c[i, 3], c[i, 4], c[i, 5]), (c[i, 6], c[i, 7], c[i, 8]))
    st, ss, cs = math.sin(theta), math.sin(psi), math.cos(psi)
    omega = (
        phi_rate * st * ss + theta_rate * cs,
        phi_rate * st * cs - theta_rate * ss,
        phi_rate * math.cos(theta) + psi_rate,
    )
    return PayloadState(matmul(euler_313_dcm(phi, theta, psi), dcm_hn), omega)


def inertia_ratio(spin_hz: float, coning_period: float, half_angle: float) -> float:
    """Axial over transverse moment of inertia of a body that turns and cones like this.

    Args:
        spin_hz: turns a second relative to an inertial direction outside the cone [Hz].
        coning_period: of the axis about the angular momentum [s].
        half_angle: of the cone [rad].
    """
    precession = _FULL_TURN / coning_period
    axial = precession * math.cos(half_angle)
    return axial / (_FULL_TURN * spin_hz - precession + axial)


def payload_motion(values: Values, epoch_ns: int, key: RandomKey) -> PayloadMotion:
    """Motion of one case (sections payload and orbit), from a roll and a coning phase that are drawn for it."""
    first_roll, first_phase = (_FULL_TURN * u for u in uniform4(key, Stream.SPIN_PHASE, 0, 0)[:2])
    starts = values[PHASE_STARTS].tolist()
    ends = [*starts[1:], values[FLAT_SPIN_START]]
    phases: list[tuple] = []
    dcm_hn = _momentum_frame(values, epoch_ns)
    psi, phi = first_roll, first_phase
    fastest = 0.0
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        theta = 0.5 * math.radians(values[CONING_ANGLE][i])
        if i > 0:
            # the body stays as it is; its h turns to the new angle, in the plane of the old h and the axis
            dcm_bn = _state_of(phases, start).dcm_bn
            dcm_hn = np.asarray(matmul(transpose(euler_313_dcm(0.0, theta, psi)), dcm_bn))
            phi = 0.0
        rate = _FULL_TURN / values[CONING_PERIOD][i]
        acceleration = 0.0
        if i == len(starts) - 1 and values[FINAL_CONING_PERIOD] > 0.0:
            acceleration = (_FULL_TURN / values[FINAL_CONING_PERIOD] - rate) / (end - start)
        turn_rate = _FULL_TURN * values[SPIN][i]
        spin_rate = turn_rate - rate
        phases.append((start, (phi, rate, acceleration), (theta, 0.0, theta), (psi, spin_rate), dcm_hn))
        t = end - start
        psi += (spin_rate - 0.5 * acceleration * t) * t
        phi += (rate + 0.5 * acceleration * t) * t
        fastest = max(fastest, abs(turn_rate) + 2.0 * rate)
    final_rate = rate + acceleration * t
    opening = math.radians(values[FLAT_SPIN_RATE])
    largest = math.radians(values[FLAT_SPIN_ANGLE])
    phases.append(
        (
            values[FLAT_SPIN_START],
            (phi, final_rate, 0.0),
            (theta, opening, largest),
            (psi, turn_rate - final_rate),
            dcm_hn,
        )
    )
    return _motion(phases, fastest + opening)


def _momentum_frame(values: Values, epoch_ns: int) -> np.ndarray:
    """Rows of a frame along the angular momentum at the epoch, in n."""
    azimuth, elevation = math.radians(values[AXIS_AZIMUTH]), math.radians(values[AXIS_ELEVATION])
    launch = mission_launch(values)
    z = local_direction_n(launch, epoch_ns, azimuth, elevation)
    x = local_direction_n(launch, epoch_ns, azimuth, elevation - 0.5 * math.pi)
    return np.array([x, np.cross(z, x), z])


def _motion(phases: list, fastest: float) -> PayloadMotion:
    start, precession, nutation, spin, dcm_hn = zip(*phases, strict=True)
    return PayloadMotion(
        np.array(start, dtype=np.float64),
        np.array(precession, dtype=np.float64),
        np.array(nutation, dtype=np.float64),
        np.array(spin, dtype=np.float64),
        np.array(dcm_hn, dtype=np.float64).reshape(len(phases), 9),
        fastest,
    )


def _state_of(phases: list, time: float) -> PayloadState:
    return payload_state(_motion(phases, 0.0), time)
