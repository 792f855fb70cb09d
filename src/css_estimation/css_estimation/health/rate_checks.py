# SPDX-License-Identifier: Apache-2.0
"""What one axis of a gyro says about itself, from sample to sample.

range    not a number, or a rate beyond any of this spacecraft
spike    farther from the last good sample than noise and torques can bring it: that one is left out. When the next
         ones agree with it, it was a jump: the body cannot have done it, so the error of the gyro has changed by it
stuck    so often the very same number that noise and rounding would show it once in 1e9 runs, and once in as many of
         this axis, by how often its samples have repeated so far: telemetry may be rounded more coarsely than the
         sensor, which shows in the smallest change of any axis, and a body at rest then reads the same for ever; judged
         once an axis of the sensor has shown noise
noise    squared differences of successive samples, averaged, beyond what noise and torques make of them

A body without torque changes its rate by |J^-1 (w x J w)| < |w|^2 at most, whatever its moments of inertia, which add
up as those of a body do; control adds `acceleration`.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.actuator_sections import WHEEL_MAX_TORQUE, WHEELS_FITTED, of_each_wheel, wheel_axes
from css_common.declared import computed, given, made, table_of
from css_common.kernel import kernel
from css_common.matrices import inverse
from css_common.normal_distribution import normal_share
from css_common.schema import Values, real
from css_common.sections import INERTIA
from css_common.vectors import mat3

_FALSE_ALARM = 1e-9  # of one run of samples
_LOG_FALSE_ALARM = math.log(_FALSE_ALARM)
_PRIOR = 2.0  # samples that repeat, and as many that do not, that an axis is thought to have shown
_FEWEST_EQUAL = 5  # a message that came twice or thrice is not a stuck axis
_MOST_EQUAL = 1000
_FOR_EVER = 1_000_000_000  # samples
_COARSE = 2.0  # standard deviations of noise in a step
_FARTHEST = 7.0  # of those, for which a share is known
_AGREEING = 4  # samples in a row make a jump
_SHARE = 1.0 / 20.0  # of a new sample in averages
_SIGMAS = 6.0
_RESTLESS = 2.0  # mean squared change over that of noise
# Squared differences of neighbours have their noise in common: an average of 39 of them is worth so many that do not.
DEGREES_OF_FREEDOM = (2.0 / _SHARE - 1.0) / 1.5
MOST_REFUSED = 0.3
"""Share of the samples, averaged, that may be spikes."""

NOISE = real("health.gyro.noise_deg_s", 0.03, "deg/s", "white noise of a sample, 1 sigma", low=1e-9, high=100.0)
RESOLUTION = real(
    "health.gyro.resolution_deg_s", 0.0, "deg/s", "step of its output; 0: continuous", low=0.0, high=100.0
)

GYRO_AXIS = np.dtype(
    [
        ("raw", np.float64),  # last sample [rad/s]
        ("good", np.float64),  # last that was used
        ("jump", np.float64),  # of the last jump
        ("change", np.float64),  # [rad2/s2] mean squared change from sample to sample
        ("refused", np.float64),  # [-] share of the samples, averaged
        ("gap", np.float64),  # [s] since the last good sample
        ("equal", np.int64),  # samples in a row that were as the one before
        ("agreeing", np.int64),  # refused samples in a row that agree with one another
        ("seen", np.int64),  # there is a sample
        ("zeros", np.int64),  # spells of exact zeros so far
        ("came_by_jump", np.int64),  # what it reads now was jumped to
        ("jumped", np.int64),  # in this cycle
        ("changes", np.int64),  # samples that were not as the one before
        ("repeats", np.int64),  # samples that were, of no run more than may be usual
        ("least_change", np.float64),  # [rad/s] smallest one so far; 0: none
    ],
    align=True,
)
"""One axis from cycle to cycle."""

SAMPLE_GOOD, SAMPLE_REFUSED, SAMPLE_JUMPED, SAMPLE_STUCK, SAMPLE_RANGE, SAMPLE_NOISY, SAMPLE_SPIKY = range(7)


def gamma_quantile(degrees_of_freedom: float, sigmas: float) -> float:
    """Chi-square over its degrees of freedom, passed as rarely as a normal passes `sigmas` (Wilson and Hilferty)."""
    k = 2.0 / (9.0 * degrees_of_freedom)
    return (1.0 - k + sigmas * math.sqrt(k)) ** 3


@kernel
def rounding_run(noise: float, resolution: float) -> int:
    """How many samples in a row are as the one before once in 1e9 times, by noise and rounding, at the worst rate.

    Args:
        noise: of a sample, 1 sigma.
        resolution: step of the output, in the same unit.
    """
    steps = resolution / noise
    # the chance that two normals fall into one step: the density of their difference at 0 times the step
    chance = 0.5 * steps / math.sqrt(math.pi)
    if steps > _COARSE:
        # wherever the steps are narrow; of wide ones a rate in the middle of one is likeliest to stay there
        beyond = normal_share(-min(0.5 * steps, _FARTHEST))[0]
        chance = (1.0 - 2.0 * beyond) ** 2 + 2.0 * beyond * beyond
    if chance <= 0.0:
        return 0
    if chance >= 1.0 + _LOG_FALSE_ALARM / _FOR_EVER:
        return _FOR_EVER
    return math.ceil(_LOG_FALSE_ALARM / math.log(chance))


def equal_count(noise: float, resolution: float) -> int:
    """How many samples in a row must be as the one before until noise and rounding no longer explain it."""
    return max(rounding_run.py_func(noise, resolution), _FEWEST_EQUAL)


ACCELERATION = real(
    "health.gyro.acceleration_deg_s2",
    1.0,
    "deg/s^2",
    "largest angular acceleration by actuators, or by all wheels where they and the inertia are known, if that is more",
    low=0.0,
    high=1e4,
)


def _acceleration(values: Values) -> float:
    """Largest angular acceleration by what is said, and by all wheels together [rad/s2]."""
    said = math.radians(values[ACCELERATION])
    if INERTIA not in values or WHEELS_FITTED not in values or not len(values[INERTIA]):
        return said
    axes = wheel_axes(values)
    torques = np.einsum("n,ni->i", of_each_wheel(values, WHEEL_MAX_TORQUE)[: len(axes)], abs(axes))
    by_wheels = np.einsum("ij,j->i", abs(np.array(inverse(mat3(values[INERTIA])))), np.nan_to_num(torques))
    return max(said, float(np.max(by_wheels)))


class RateChecks(NamedTuple):
    """Rates in rad/s."""

    noise: float = made(math.radians, NOISE)
    gate: float = made(
        lambda noise, resolution: _SIGMAS * math.sqrt(2.0) * math.radians(noise) + math.radians(resolution),
        NOISE,
        RESOLUTION,
    )
    difference: float = made(  # [rad2/s2] mean square of the difference of two samples
        lambda noise, resolution: 2.0 * math.radians(noise) ** 2 + math.radians(resolution) ** 2 / 6.0,
        NOISE,
        RESOLUTION,
    )
    largest_change: float = computed(lambda values: gamma_quantile(DEGREES_OF_FREEDOM, _SIGMAS))
    equal: int = made(equal_count, NOISE, RESOLUTION)
    acceleration: float = computed(_acceleration, ACCELERATION)  # [rad/s2]
    patience: float = given(
        real("health.gyro.patience", 1.0, "s", "without a number for longer an axis fails", low=0.0, high=1e4)
    )
    limit: float = made(
        math.radians,
        real("health.gyro.range_deg_s", 300.0, "deg/s", "no rate of this spacecraft is larger", low=0.1, high=1e5),
    )


PARAMETERS = table_of(RateChecks)


LARGEST_UNKNOWN = 0.25
"""Variance [rad^2] of a turn, per axis, beyond which the rates before and after say nothing of it."""


@kernel
def unknown_turn(p: RateChecks, rate: float, dt: float) -> float:
    """Variance of the turn between two samples [rad^2], per axis, that no mean of the two rates tells.

    Between them the rate may have gone away and come back as fast as torques allow, and so a quarter of that times the
    square of the time: 3 sigma. It is next to nothing for steps of a second, and everything for those of a minute.

    Args:
        rate: of the body [rad/s], all axes.
        dt: [s] from one sample to the other.
    """
    bound = 0.25 * (p.acceleration + rate * rate) * dt * dt
    return bound * bound / 9.0


def new_axes() -> np.ndarray:
    """Nothing seen on any axis."""
    return np.zeros(3, GYRO_AXIS)


@kernel
def has_noise(axes) -> bool:
    """Whether some axis (3,) has shown noise: one of a sensor without any may read the same for ever."""
    return axes[0].changes >= _FEWEST_EQUAL or axes[1].changes >= _FEWEST_EQUAL or axes[2].changes >= _FEWEST_EQUAL


@kernel
def step_seen(axes) -> float:
    """Step of the output [rad/s] as far as axes (3,) have shown it, their smallest change; 0: none has changed."""
    step = 0.0
    for i in range(3):
        least = axes[i].least_change
        if least > 0.0 and (step == 0.0 or least < step):
            step = least
    return step


@kernel
def longest_run(p: RateChecks, axis, resolution: float) -> int:
    """How many samples in a row must be as the one before until neither noise nor rounding explains it.

    Args:
        resolution: step of the output as it has shown itself.
    """
    # the chance of the most usual number is no more than the root of that of a repetition, the sum of all squared
    chance = math.sqrt((axis.repeats + _PRIOR) / (axis.repeats + axis.changes + 2.0 * _PRIOR))
    usual = min(math.ceil(_LOG_FALSE_ALARM / math.log(chance)), _MOST_EQUAL)
    return max(p.equal, usual, rounding_run(p.noise, resolution))


@kernel
def forget_samples(axis) -> None:
    """After a silence: the next sample is the first."""
    axis.seen = axis.equal = axis.agreeing = 0
    axis.change = axis.refused = axis.gap = 0.0


@kernel
def check_sample(p: RateChecks, axis, dt: float, x: float, speed: float, resolution: float) -> int:
    """Judges one sample; `axis.good` is the rate to go on with [rad/s].

    Args:
        axis: of GYRO_AXIS, advanced.
        dt: [s] since the last sample.
        x: the sample [rad/s].
        speed: rate of the body [rad/s], all axes.
        resolution: step of the output [rad/s] as the sensor has shown it; 0: not yet.

    Returns:
        SAMPLE_*; a jump is in `axis.jump`.
    """
    axis.jumped = 0
    # a NaN compares false
    if not abs(x) <= p.limit:
        axis.gap += dt
        return SAMPLE_RANGE
    if axis.seen == 0:
        axis.raw = axis.good = x
        axis.seen = 1
        return SAMPLE_GOOD
    axis.gap += dt
    by_torque = p.acceleration + speed * speed
    change = x - axis.raw
    step = p.gate + by_torque * dt
    if change == 0.0:
        axis.equal += 1
    else:
        if axis.equal > 0:
            axis.repeats += min(axis.equal, longest_run(p, axis, resolution))
            axis.equal = 0
        axis.changes += 1
        axis.least_change = abs(change) if axis.least_change == 0.0 else min(axis.least_change, abs(change))
        axis.came_by_jump = 1 if abs(change) > step else 0
        axis.zeros += 1 if x == 0.0 else 0
    axis.raw = x
    if axis.equal >= p.equal and axis.equal >= longest_run(p, axis, resolution):
        return SAMPLE_STUCK
    off = abs(x - axis.good) > p.gate + by_torque * axis.gap
    axis.refused += _SHARE * ((1.0 if off else 0.0) - axis.refused)
    if axis.refused > MOST_REFUSED:
        axis.good, axis.gap, axis.agreeing = x, 0.0, 0
        return SAMPLE_SPIKY
    if off:
        axis.agreeing = axis.agreeing + 1 if abs(change) <= step else 1
        if axis.agreeing < _AGREEING:
            return SAMPLE_REFUSED
        axis.jump, axis.jumped = x - axis.good, 1
        axis.good, axis.gap, axis.agreeing = x, 0.0, 0
        return SAMPLE_JUMPED
    axis.agreeing = 0
    axis.good, axis.gap = x, 0.0
    if abs(change) <= step:
        axis.change += _SHARE * (change * change - axis.change)
    torque = by_torque * dt
    return SAMPLE_NOISY if axis.change > p.largest_change * (p.difference + torque * torque) else SAMPLE_GOOD


@kernel
def restless(p: RateChecks, axis) -> bool:
    """Whether samples change by more than noise also where they are no spikes."""
    return axis.change > _RESTLESS * p.difference
