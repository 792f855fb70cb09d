# SPDX-License-Identifier: Apache-2.0
"""Sun angle, Sun vector and rate of one passage through the slits, with what they may be wrong by."""

import math
from typing import NamedTuple

from css_common.conversions import square_of_degrees
from css_common.declared import builder, computed, given, made, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values, real
from css_common.vectors import Vec3
from css_estimation.spin import slit_angles
from css_estimation.spin.slit_passage import Passage, PassageParameters
from css_estimation.symmetric import Symmetric
from css_sensors.slits import slit_inclination, timer_frequency

INERTIA_RATIO = real(
    "inertia_ratio", 0.0, "-", "axial over transverse moment of inertia; 0: unknown", low=0.0, high=2.0
)
_JITTER = real("jitter_us", 0.0, "us", "1 sigma of the delay of a pulse", low=0.0, high=1e4)

# A cut count lies half a count before the pulse, on average.
HALF_COUNT = 0.5
# Weight of a new sample in the mean swing: some 30 samples are remembered; the prior counts as a few.
_WEIGHT = 0.03
_PRIOR_SAMPLES = 3


def _jitter(values: Values) -> float:
    return 1e-6 * values[_JITTER] * timer_frequency(values)


class SlitParameters(NamedTuple):
    """All of the measurement, with the mission's `slits`."""

    passage: PassageParameters = part(PassageParameters)
    frequency: float = computed(timer_frequency)  # [Hz]
    inclination: float = computed(slit_inclination)  # [rad]
    inertia_ratio: float = given(INERTIA_RATIO)
    jitter: float = computed(_jitter, _JITTER)  # [counts]
    prior_variance: float = made(  # [rad^2]
        square_of_degrees,
        real("coning_prior_deg", 5.0, "deg", "1 sigma of the Sun angle's swing before it is known", low=0.0, high=45.0),
    )


PARAMETERS = table_of(SlitParameters)
parameters = builder(SlitParameters)


class Swing(NamedTuple):
    """Running mean and variance of the Sun angle [rad, rad^2]."""

    samples: int
    mean: float
    variance: float


class SunAngle(NamedTuple):
    """One measurement."""

    sun_b: Vec3
    covariance: Symmetric  # of sun_b
    angle: float  # [rad]
    sigma: float  # [rad]
    rate: float  # [rad/s]


def initial_swing(p: SlitParameters) -> Swing:
    """Nothing measured."""
    return Swing(0, 0.0, p.prior_variance)


@kernel
def _swung(swing: Swing, angle: float) -> Swing:
    if swing.samples == 0:
        return Swing(1, angle, swing.variance)
    off = angle - swing.mean
    weight = max(_WEIGHT, 1.0 / (swing.samples + _PRIOR_SAMPLES))
    return Swing(swing.samples + 1, swing.mean + weight * off, swing.variance + weight * (off * off - swing.variance))


@kernel
def measure(p: SlitParameters, swing: Swing, passage: Passage, azimuth: float) -> tuple[Swing, SunAngle]:
    """The measurement of a passage of a head at an azimuth [rad] around the spin axis.

    Its covariance counts whole counts and jitter, and the motion of the axis during the passage as far as the swing
    of the last Sun angles tells it.
    """
    angle = slit_angles.sun_angle(passage.interval, passage.turn, p.inclination)
    rate = slit_angles.rotation_rate(passage.turn, p.frequency)
    swing = _swung(swing, angle)
    variance = slit_angles.counting_variance(passage.interval, passage.turn, p.inclination, p.jitter)
    variance += slit_angles.motion_variance(angle, p.inclination, p.inertia_ratio, swing.variance)
    azimuth_variance = (rate / p.frequency) ** 2 * (slit_angles.CUT_VARIANCE + p.jitter * p.jitter)
    covariance = slit_angles.sun_covariance(angle, azimuth, variance, azimuth_variance)
    return swing, SunAngle(slit_angles.sun_vector(angle, azimuth), covariance, angle, math.sqrt(variance), rate)
