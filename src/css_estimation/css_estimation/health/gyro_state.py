# SPDX-License-Identifier: Apache-2.0
"""What is thought of the gyro: parameters, modes, and what is kept from cycle to cycle; `gyro_health` advances it.

TRUSTED    its rate is given on untouched
CORRECTED  all that is wrong with it is a bias, which is estimated and taken off: constant, a step, a slow drift
LEFT       it is wrong in a way that no bias explains, or its samples are: estimators go on without

A gyro that is left is tried all the time: when through a trial of `health.gyro.return_time` its error has been that of
a constant bias, it is used again. Each time that it has to be left once more the trials get twice as long.
"""

import math
from typing import NamedTuple

from css_common.conversions import square
from css_common.declared import computed, given, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import real
from css_common.vectors import Vec3
from css_estimation.health.gyro_bias import Bias, unknown_bias, variance_along
from css_estimation.health.gyro_fit import NO_SHAPE, Shape, forget_fits
from css_estimation.health.rate_checks import RateChecks, gamma_quantile
from css_estimation.health.sight_line import NO_SIGHT_LINE, SightLine, SightLineParameters

GYRO_TRUSTED, GYRO_CORRECTED, GYRO_LEFT = range(3)

_SIGMAS = 6.0
# Innovations averaged over ten blocks of two components.
_NIS_DEGREES = 2.0 * 19.0
# What the light of the Earth makes of directions to the Sun is no white noise: twice their sigma.
_OTHER_ERRORS = 4.0
# Of the largest bias, beyond which there is no bias that is taken off.
_SIGMAS_OF_BIAS = 2.0
_LONGEST_TRIAL = 3600.0  # [s]


LARGEST_BIAS = real(
    "health.gyro.largest_bias_deg_s", 10.0, "deg/s", "bias of a gyro that failed, 1 sigma", low=0.1, high=1e3
)


def _variance(rate_deg_s: float) -> float:
    return math.radians(rate_deg_s) ** 2


class GyroHealthParameters(NamedTuple):
    """Variances in rad^2/s^2, times in s."""

    checks: RateChecks = part(RateChecks)
    sight: SightLineParameters = part(SightLineParameters)
    usual_bias: float = made(
        _variance,
        real("health.gyro.bias_deg_s", 0.1, "deg/s", "bias of a good gyro, per axis, 1 sigma", low=1e-6, high=100.0),
    )
    usual_scale: float = made(
        square, real("health.gyro.scale_error", 0.01, "-", "scale error of a good gyro, 1 sigma", low=0.0, high=1.0)
    )
    usual_drift: float = made(
        _variance,
        real("health.gyro.drift_deg_s2", 1e-3, "deg/s^2", "drift of its bias, 1 sigma", low=0.0, high=1.0),
    )
    walk: float = made(  # [rad2/s3]
        _variance,
        real("health.gyro.walk_deg_s", 1e-3, "deg/s", "change of its bias within a second, 1 sigma", low=0.0, high=1.0),
    )
    body_rate: float = made(
        _variance,
        real(
            "health.gyro.body_rate_deg_s",
            2.0,
            "deg/s",
            "rate of a body of which nothing is known, per axis, 1 sigma",
            low=1e-3,
            high=100.0,
        ),
    )
    largest_bias: float = made(_variance, LARGEST_BIAS)
    largest_error: float = made(lambda rate: _SIGMAS_OF_BIAS * math.radians(rate), LARGEST_BIAS)  # [rad/s]
    threshold: float = made(
        square,
        real("health.gyro.sigmas", _SIGMAS, "-", "beyond so many sigma the gyro is wrong", low=3.0, high=100.0),
    )
    agreement: float = made(
        square,
        real("health.gyro.return_sigmas", 3.0, "-", "within so many it is right again", low=1.0, high=100.0),
    )
    largest_nis: float = computed(lambda values: _OTHER_ERRORS * gamma_quantile(_NIS_DEGREES, _SIGMAS))
    largest_misfit: float = given(
        real(
            "health.gyro.misfit",
            2.0,
            "-",
            "squared sigmas per cell, averaged, beyond which cells contradict a Sun line that the gyro leads",
            low=0.01,
            high=1e4,
        )
    )
    block: float = given(
        real("health.gyro.block", 1.0, "s", "time after which gyro and Sun line are compared", low=1e-3, high=100.0)
    )
    memory: float = given(real("health.gyro.memory", 120.0, "s", "how long a comparison counts", low=1.0, high=1e6))
    return_time: float = given(
        real("health.gyro.return_time", 15.0, "s", "first trial of a gyro that was left", low=1.0, high=1e5)
    )
    silence: float = given(
        real("health.gyro.silence", 2.0, "s", "without a reading for longer it is held for failed", low=0.0, high=1e5)
    )


PARAMETERS = table_of(GyroHealthParameters)


class Readings(NamedTuple):
    """The last ones."""

    rate_b: Vec3  # [rad/s] last good one
    before_b: Vec3  # [rad/s] the one before
    dt: float  # [s] between the two
    spoken: bool  # there has been one
    silent: float  # [s] since there was


class Opinion(NamedTuple):
    """What is thought of the error."""

    mode: int  # GYRO_*
    bias: Bias
    drift: float  # [rad/s2] of a bias that drifts: it is given room to
    fit_time: float  # [s] since the fits were empty
    trial: float  # [s] into a trial, of a gyro that is left; since there was a bias, of one that is corrected
    trial_failed: bool
    claim: Shape  # an error that goes with the rate, for which the gyro was left
    trial_time: float  # [s] how long a trial is


class GyroState(NamedTuple):
    """From cycle to cycle."""

    readings: Readings
    opinion: Opinion
    sight: SightLine


def initial_state(p: GyroHealthParameters) -> GyroState:
    """Trusted, nothing read yet."""
    zero = (0.0, 0.0, 0.0)
    bias = Bias(zero, (p.largest_bias, 0.0, 0.0, p.largest_bias, 0.0, p.largest_bias), 1.0, 0)
    # the first time that it is left doubles it
    opinion = Opinion(GYRO_TRUSTED, bias, 0.0, 0.0, 0.0, False, NO_SHAPE, 0.5 * p.return_time)
    return GyroState(Readings(zero, zero, 0.0, False, 0.0), opinion, NO_SIGHT_LINE)


@kernel
def unseen_sigma(state: GyroState, sun_b: Vec3) -> float:
    """What is not known of the rate about the Sun line [rad/s], 1 sigma, for the bias that could hide there."""
    return math.sqrt(max(variance_along(state.opinion.bias, sun_b), 0.0))


@kernel
def anew(p: GyroHealthParameters, fits, mode: int, claim: Shape, trial_time: float) -> Opinion:
    """Another mode, with all that was learnt of the error forgotten but for a claim."""
    forget_fits(fits)
    return Opinion(mode, unknown_bias(p.largest_bias), 0.0, 0.0, 0.0, False, claim, trial_time)


@kernel
def leave(p: GyroHealthParameters, opinion: Opinion, fits, claim: Shape) -> Opinion:
    """The gyro is left, from whatever mode; one that had come back has a longer trial before it."""
    again = opinion.mode != GYRO_LEFT
    longer = min(2.0 * opinion.trial_time, _LONGEST_TRIAL) if again else opinion.trial_time
    return anew(p, fits, GYRO_LEFT, claim, longer)
