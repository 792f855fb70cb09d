# SPDX-License-Identifier: Apache-2.0
"""Readings that are older than their stamps: the delay of a sensor, or a time tag that is late.

What bears the stamp of cycle k is what there was at t_k less the latency: attitude, rate, direction and strength of the
Sun and the field. Between two cycles they are interpolated linearly, attitudes as MRPs of one set, which is good to
1e-6 rad at 2 deg/s and ten cycles a second. Before the epoch there was what there is at the epoch. The light of the
Earth is that of the stamp, which moves by 0.07 deg a second. Noise and walking biases are those of the stamp's cycle.
A sensor that was restarted or switched on takes the oldest that there was since.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, computed, table_of
from css_common.kernel import kernel
from css_common.mission_section import PERIOD
from css_common.random_streams import RandomKey, Stream, uniform4
from css_common.schema import Values, real
from css_common.vectors import Vec3, add, dot, norm, scale, subtract

CELLS, GYRO, MAGNETOMETER = 0, 1, 2
"""Sensors, each of which has a draw of its own."""

_LATENCY = real(
    "latency", 0.0, "s", "time by which a reading is older than its stamp, by delay or time tag", low=0.0, high=10.0
)
_SPREAD = real("latency_spread", 0.0, "s", "largest difference of a case from that, uniform", low=0.0, high=10.0)
_VECTORS = ("sigma_bn", "omega_bn_b", "sun_n", "field_n")
_ROUNDING = 1e-9  # [cycles] from a whole number that a latency is taken for one


def _lag(values: Values) -> float:
    cycles = values[_LATENCY] / values[PERIOD]
    return float(round(cycles)) if abs(cycles - round(cycles)) < _ROUNDING else cycles


def _spread(values: Values) -> float:
    return values[_SPREAD] / values[PERIOD]


class Latency(NamedTuple):
    """Of one sensor, in control cycles."""

    lag: float = computed(_lag, _LATENCY)
    spread: float = computed(_spread, _SPREAD)


PARAMETERS = table_of(Latency)
parameters = builder(Latency)

NO_LATENCY = Latency(0.0, 0.0)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    if values[_SPREAD] > values[_LATENCY]:
        yield f"latency_spread: {values[_SPREAD]:g} given, expected at most latency: no reading is from after its stamp"


class Moment(NamedTuple):
    """What there is to sense at one instant."""

    sigma_bn: Vec3
    omega_bn_b: Vec3  # [rad/s]
    sun_n: Vec3
    intensity: float  # [-] solar flux relative to 1 AU times the visible fraction of the disc
    field_n: Vec3  # [T]


MOMENT = np.dtype(
    [("step", np.int64), *((name, np.float64, 3) for name in _VECTORS), ("intensity", np.float64)], align=True
)
"""`Moment` of a control cycle, in a ring of them."""


def longest_lag(p: Latency) -> float:
    """Control cycles that no case exceeds."""
    return p.lag + p.spread


def new_history(lag: float) -> np.ndarray:
    """Room for what happened over the last `lag` control cycles: (L,) of MOMENT."""
    history = np.zeros(math.ceil(lag) + 2, MOMENT)
    history["step"] = -1
    return history


@kernel
def draw_lag(p: Latency, key: RandomKey, sensor: int) -> float:
    """Latency [control cycles] of a sensor of a case."""
    if p.spread <= 0.0:
        return p.lag
    return p.lag + p.spread * (2.0 * uniform4(key, Stream.LATENCY, 0, sensor)[0] - 1.0)


@kernel
def remember(history, step: int, now: Moment) -> None:
    """Keeps what there is at a control cycle."""
    m = history[step % history.shape[0]]
    m.step = step
    for i in range(3):
        m.sigma_bn[i], m.omega_bn_b[i] = now.sigma_bn[i], now.omega_bn_b[i]
        m.sun_n[i], m.field_n[i] = now.sun_n[i], now.field_n[i]
    m.intensity = now.intensity


@kernel
def sensed(history, step: int, lag: float, now: Moment, since: int) -> Moment:
    """What a sensor senses at a control cycle, `lag` cycles late; 0: what there is now.

    Args:
        history: (L,) of MOMENT, with `now` in it.
        since: control cycle at which the sensor was switched on.
    """
    if lag <= 0.0:
        return now
    whole = math.floor(lag)
    late = _moment(history, step, step - whole, since)
    if lag == whole:
        return late
    early = _moment(history, step, step - whole - 1, since)
    part = lag - whole
    return Moment(
        _between(_same_set(late.sigma_bn, early.sigma_bn), early.sigma_bn, part),
        _between(late.omega_bn_b, early.omega_bn_b, part),
        _between(late.sun_n, early.sun_n, part),
        late.intensity + part * (early.intensity - late.intensity),
        _between(late.field_n, early.field_n, part),
    )


@kernel
def _same_set(sigma: Vec3, near: Vec3) -> Vec3:
    """Of the two MRPs of an attitude that which lies nearer to another's."""
    s = dot(sigma, sigma)
    if s < 0.25:  # its shadow is beyond 2
        return sigma
    shadow = scale(-1.0 / s, sigma)
    return shadow if norm(subtract(shadow, near)) < norm(subtract(sigma, near)) else sigma


@kernel
def _between(late: Vec3, early: Vec3, part: float) -> Vec3:
    return add(late, scale(part, subtract(early, late)))


@kernel
def _moment(history, step: int, wanted: int, since: int) -> Moment:
    """What there was at a cycle, or at the first one after it that is known."""
    size = history.shape[0]
    known = max(wanted, step - size + 1, since)
    while known < step and history[known % size].step != known:
        known += 1
    m = history[known % size]
    return Moment(_vector(m.sigma_bn), _vector(m.omega_bn_b), _vector(m.sun_n), m.intensity, _vector(m.field_n))


@kernel
def _vector(v) -> Vec3:
    return (v[0], v[1], v[2])
