# SPDX-License-Identifier: Apache-2.0
"""What the judgement of wheels and tachometers takes from a mission."""

import math
from typing import NamedTuple

from css_common.declared import builder, computed, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import flag, integer, real
from css_common.vectors import Mat3, mat3

_RPM = math.pi / 30.0


class HealthParameters(NamedTuple):
    """How wheels and tachometers are judged."""

    enabled: bool = given(flag("health.enabled", True, "judge wheels and tachometers, and fly without those that fail"))
    window: float = given(
        real(
            "health.window",
            1.0,
            "s",
            "time over which speeds are held against commands",
            low=0.0,
            open_low=True,
            high=60.0,
        )
    )
    sigma: float = given(
        real(
            "health.sigma",
            6.0,
            "-",
            "deviations of noise beyond which a contradiction is none of noise",
            low=3.0,
            high=100.0,
        )
    )
    speed_noise: float = made(  # [rad/s]
        lambda rpm: rpm * _RPM,
        real(
            "health.tachometer_noise_rpm", 3.0, "rpm", "1 sigma of a reported speed, steps included", low=0.01, high=1e4
        ),
    )
    friction: float = given(
        real("health.friction", 0.25, "-", "ordinary friction of a wheel, of its largest torque", low=0.0, high=1.0)
    )
    torque_error: float = given(
        real("health.torque_error", 0.15, "-", "ordinary error of a wheel's torque, relative", low=0.0, high=0.5)
    )
    rate_noise: float = made(
        math.radians,
        real("health.rate_noise_deg_s", 0.02, "deg/s", "1 sigma of a rate from the gyro", low=1e-6, high=10.0),
    )
    rate_cutoff: float = given(
        real(
            "health.rate_cutoff",
            0.1,
            "Hz",
            "corner of the estimator's low-pass on that rate; 0: none",
            low=0.0,
            high=1e3,
        )
    )
    patience: float = given(
        real(
            "health.patience",
            5.0,
            "s",
            "time in which the body may tell a wheel from its tachometer",
            low=0.0,
            high=1e4,
        )
    )
    pause: float = given(
        real("health.pause", 30.0, "s", "from a trial of a wheel to the next, at first", low=1.0, high=1e5)
    )
    returns: int = given(integer("health.returns", 3, "-", "trials in a row that a wheel must pass", low=1, high=100))
    agreement: float = given(
        real(
            "health.agreement",
            10.0,
            "s",
            "time of agreement, its wheel turned, after which a tachometer is believed again",
            low=1.0,
            high=1e5,
        )
    )
    inertia_b: Mat3 = computed(lambda values: mat3(values.spacecraft.inertia))  # [kg m^2]


PARAMETERS = table_of(HealthParameters)
parameters = builder(HealthParameters)


@kernel
def reading_noise(p: HealthParameters, inertia: float) -> float:
    """1 sigma [N m s] of a momentum that the tachometer of a wheel of some spin inertia [kg m^2] reports."""
    return inertia * p.speed_noise


@kernel
def beyond_noise(p: HealthParameters, inertia: float) -> float:
    """Difference [N m s] of two reported momenta that is none of noise."""
    return math.sqrt(2.0) * p.sigma * reading_noise(p, inertia)
