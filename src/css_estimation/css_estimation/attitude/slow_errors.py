# SPDX-License-Identifier: Apache-2.0
"""Errors of the models that last: bias of the magnetometer, error of the field model, brightness of the Earth.

A filter that takes them for white noise averages them away with the noise, and says a tenth of a degree where it errs
by half of one. Here they are states beside attitude and gyro bias. They are estimated, not considered (Schmidt), as a
body that turns tells them apart: a bias turns with the body, the field's error stays with the Earth, and cells that
look away from the Sun measure the brightness of the Earth alone.

* The magnetometer's bias, in b, walks.
* The error of the field model, in n, is smooth along the orbit: a Gauss-Markov process of second order, critically
  damped, with the correlation (1 + t/T) exp(-t/T). What a model that ends at a low degree leaves out is known by its
  size (`omitted_field`), and T by the curvature of the first Legendre polynomial that is left out: P_n(cos theta) =
  1 - n (n + 1) theta^2 / 4 + ..., with theta = v t / R over ground.
* The Earth is by a factor brighter than the model, another one over land, sea and clouds: Gauss-Markov about one.
"""

import math
from typing import NamedTuple

import numpy as np

from css_common.conversions import square
from css_common.declared import made
from css_common.kernel import kernel
from css_common.schema import choice, real
from css_common.vectors import Vec3
from css_environment.constants import EARTH_RADIUS
from css_environment.magnetic_field import HIGHEST_DEGREE, omitted_field
from css_estimation.attitude.flight_references import FIELD_DEGREE
from css_estimation.sun.error_covariance import FURTHER, fade, mix, set_single

MAGNETOMETER, FIELD, FIELD_RATE, BRIGHTNESS, END = (FURTHER + k for k in (0, 3, 6, 9, 10))
"""Where each kind of slow error begins, and the index after the last."""

ERROR_MODEL = choice(
    "error_model",
    "lasting",
    ("lasting", "white"),
    "errors of magnetometer, field model and Earthlight as states that last, or all errors white as in the paper",
)

_LARGEST_BRIGHTNESS = 10.0
# Over ground, in a low orbit [m/s].
_SPEED = 7.2e3


class SlowErrors(NamedTuple):
    """How they err."""

    lasting: bool = made(lambda word: word == "lasting", ERROR_MODEL)
    bias_variance: float = made(  # of each component [T^2]
        lambda sigma_nt: (1e-9 * sigma_nt) ** 2,
        real("magnetometer_bias_sigma_nt", 100.0, "nT", "bias of the magnetometer, 1 sigma", low=0.0, high=1e5),
    )
    bias_noise: float = made(  # [T^2/s]
        lambda walk_nt: (1e-9 * walk_nt) ** 2,
        real("magnetometer_bias_walk_nt", 0.1, "nT/sqrt(s)", "walk of that bias", low=0.0, high=1e4),
    )
    field_variance: float = made(  # of each component [T^2]
        lambda degree, sigma_nt: omitted_field(degree) ** 2 + (1e-9 * sigma_nt) ** 2,
        FIELD_DEGREE,
        real(
            "reference.field_sigma_nt",
            20.0,
            "nT",
            "error of the field model beside what its degree leaves out, per axis, 1 sigma",
            low=0.0,
            high=1e5,
        ),
    )
    field_rate: float = made(lambda degree: 1.0 / _field_time(degree), FIELD_DEGREE)  # [1/s]
    brightness_variance: float = made(
        square, real("albedo.scale_sigma", 0.5, "-", "error of the Earth's brightness, relative", low=0.0, high=10.0)
    )
    brightness_rate: float = made(  # [1/s]
        lambda time: 1.0 / time,
        real("albedo.scale_time", 1000.0, "s", "how long the Earth stays so bright", low=0.0, open_low=True, high=1e9),
    )


def _field_time(degree: int) -> float:
    """T of what a field model leaves out [s]."""
    first = min(degree + 1, HIGHEST_DEGREE)
    return math.sqrt(2.0 / (first * (first + 1))) * EARTH_RADIUS / _SPEED


def new_slow() -> np.ndarray:
    """The slow quantities (10,) before anything is measured: bias [T], field error [T], its rate [T/s], brightness."""
    slow = np.zeros(END - FURTHER)
    slow[BRIGHTNESS - FURTHER] = 1.0
    return slow


@kernel
def _variance(p: SlowErrors, i: int) -> float:
    if i < FIELD:
        return p.bias_variance
    if i < FIELD_RATE:
        return p.field_variance
    return p.field_variance * p.field_rate * p.field_rate if i < BRIGHTNESS else p.brightness_variance


@kernel
def forget(p: SlowErrors, covariance, slow) -> None:
    """Nothing has been measured yet, or what was is not to be trusted."""
    for i in range(MAGNETOMETER, END):
        slow[i - FURTHER] = 0.0 if i < BRIGHTNESS else 1.0
        if p.lasting:
            set_single(covariance, i, _variance(p, i))


@kernel
def relax(p: SlowErrors, covariance, slow, dt: float) -> None:
    """Quantities and covariance after `dt` [s]."""
    if not p.lasting:
        return
    for i in range(MAGNETOMETER, FIELD):
        covariance[i, i] += p.bias_noise * dt
    decay, turn = math.exp(-dt * p.field_rate), dt * p.field_rate
    forward = (decay * (1.0 + turn), decay * dt, -decay * turn * p.field_rate, decay * (1.0 - turn))
    for i in range(FIELD, FIELD_RATE):
        k = i - FURTHER
        error, rate = slow[k], slow[k + 3]
        slow[k], slow[k + 3] = forward[0] * error + forward[1] * rate, forward[2] * error + forward[3] * rate
        mix(covariance, i, i + 3, forward, p.field_variance, p.field_variance * p.field_rate * p.field_rate)
    factor = math.exp(-dt * p.brightness_rate)
    slow[BRIGHTNESS - FURTHER] = 1.0 + factor * (slow[BRIGHTNESS - FURTHER] - 1.0)
    fade(covariance, BRIGHTNESS, factor, (1.0 - factor * factor) * p.brightness_variance)


@kernel
def correct(p: SlowErrors, slow, correction) -> None:
    """Applies the gathered corrections (n,) of all errors."""
    if p.lasting:
        for i in range(MAGNETOMETER, END):
            slow[i - FURTHER] += correction[i]
        slow[BRIGHTNESS - FURTHER] = min(max(slow[BRIGHTNESS - FURTHER], 0.0), _LARGEST_BRIGHTNESS)


@kernel
def magnetometer_bias(slow) -> Vec3:
    """Bias of the magnetometer in b [T]."""
    return (slow[0], slow[1], slow[2])


@kernel
def field_error(slow) -> Vec3:
    """What the true field has beyond the model's, in n [T]."""
    return (slow[3], slow[4], slow[5])


@kernel
def brightness(slow) -> float:
    """The Earth's, relative to the model's."""
    return slow[9]


def largest_variances(p: SlowErrors) -> list[float]:
    """Variances above which errors say no more."""
    if not p.lasting:
        return []
    bias, field = 4.0 * p.bias_variance + 1e-24, 4.0 * p.field_variance + 1e-24
    rate = 4.0 * p.field_variance * p.field_rate * p.field_rate + 1e-30
    return [bias] * 3 + [field] * 3 + [rate] * 3 + [4.0 * p.brightness_variance + 1e-12]


def first_of_cells(word: str) -> int:
    """Index of the first calibration error of the cells, by the word of `ERROR_MODEL`."""
    return END if word == "lasting" else FURTHER
