# SPDX-License-Identifier: Apache-2.0
"""The motion of a spinning payload that a mission states: phases free of torque, and the flat spin at the end."""

from collections.abc import Iterator

import numpy as np

from css_common.orbit_section import LAUNCH_LATITUDE, LAUNCH_LONGITUDE
from css_common.schema import Table, Values, real, reals

AXIS_AZIMUTH = real(
    "payload.axis_azimuth_deg",
    None,
    "deg",
    "angular momentum at the epoch, from north over east",
    low=-360.0,
    high=360.0,
    example="payload: {axis_azimuth_deg: 330.0}",
)
AXIS_ELEVATION = real(
    "payload.axis_elevation_deg",
    None,
    "deg",
    "its elevation",
    low=-90.0,
    high=90.0,
    example="payload: {axis_elevation_deg: 80.0}",
)
PHASE_STARTS = reals(
    "payload.phase_starts",
    (0.0,),
    "s",
    "when a phase of torque-free motion begins, after the epoch",
    low=0.0,
    high=1e5,
)
SPIN = reals(
    "payload.spin_hz",
    (),
    "Hz",
    "turns a second relative to the Sun in each phase",
    low=0.01,
    high=50.0,
    example="payload: {spin_hz: [5.45]}",
)
CONING_PERIOD = reals(
    "payload.coning_period",
    (),
    "s",
    "turn of the spin axis about the angular momentum in each phase",
    low=0.01,
    high=1e3,
    example="payload: {coning_period: [0.2618]}",
)
CONING_ANGLE = reals(
    "payload.coning_angle_deg",
    (),
    "deg",
    "full angle of the cone of the spin axis in each phase",
    low=0.0,
    high=120.0,
    example="payload: {coning_angle_deg: [12.89]}",
)
FINAL_CONING_PERIOD = real(
    "payload.final_coning_period",
    0.0,
    "s",
    "to which the period of the last phase drifts by its end; 0: it stays",
    low=0.0,
    high=1e3,
)
FLAT_SPIN_START = real(
    "payload.flat_spin_start", 1e5, "s", "when the cone of the last phase begins to open", low=0.0, high=1e5
)
FLAT_SPIN_RATE = real("payload.flat_spin_rate_deg_s", 4.0, "deg/s", "growth of its half angle", low=0.1, high=90.0)
FLAT_SPIN_ANGLE = real("payload.flat_spin_angle_deg", 85.0, "deg", "half angle at which it ends", low=1.0, high=89.9)

PAYLOAD: Table = (
    AXIS_AZIMUTH,
    AXIS_ELEVATION,
    PHASE_STARTS,
    SPIN,
    CONING_PERIOD,
    CONING_ANGLE,
    FINAL_CONING_PERIOD,
    FLAT_SPIN_START,
    FLAT_SPIN_RATE,
    FLAT_SPIN_ANGLE,
)


def needed_of_payload(values: Values) -> tuple[str, ...]:
    """What a component cannot do without that has to know how the payload turns, and over which place."""
    needed = (LAUNCH_LATITUDE, LAUNCH_LONGITUDE, AXIS_AZIMUTH, AXIS_ELEVATION, SPIN, CONING_PERIOD, CONING_ANGLE)
    return tuple(p.name for p in needed)


def conflicts(payload: Values) -> Iterator[str]:
    """What is wrong between the values of the section, one message each."""
    starts = payload.phase_starts
    if not len(starts) or starts[0] != 0.0 or np.any(np.diff(starts) <= 0.0):
        yield f"payload.phase_starts: {starts.tolist()} given, expected times that grow from 0.0"
        return
    for key in ("spin_hz", "coning_period", "coning_angle_deg"):
        given = getattr(payload, key)
        if not len(given):
            return  # whoever needs it asks for it
        if len(given) != len(starts):
            yield f"payload.{key}: {len(given)} values given, expected {len(starts)}, one for each phase"
            return
    for key, period in (("coning_period", payload.coning_period), ("final_coning_period", payload.final_coning_period)):
        # the ratio of axial to transverse moment of inertia, which no body has above 2
        ratio = 1.0 / (payload.spin_hz * np.where(period == 0.0, payload.coning_period, period))
        if np.any(ratio >= 2.0):
            yield f"payload.{key}: the coning is {ratio.max():.3g} times as fast as the spin, expected less than 2"
    if payload.flat_spin_start <= starts[-1]:
        yield f"payload.flat_spin_start: {payload.flat_spin_start:g} given, expected a time after the last phase begins"
    if 2.0 * payload.flat_spin_angle_deg <= payload.coning_angle_deg[-1]:
        yield "payload.flat_spin_angle_deg: expected more than half the coning angle of the last phase"
