# SPDX-License-Identifier: Apache-2.0
"""Orientation of the Earth: frame e (Earth-fixed, ITRS) relative to n."""

import math

import erfa

from css_common.kernel import kernel
from css_common.vectors import Mat3, mat3
from css_environment.constants import EARTH_ROTATION_RATE
from css_environment.time_scales import terrestrial_date, utc_date


def dcm_en_at(epoch_ns: int, elapsed_s: float = 0.0) -> Mat3:
    """Rotation from n to e by the IAU 2006/2000A models.

    UT1 is taken equal to UTC and polar motion as zero: together less than 20 arcsec.
    """
    dates = (*terrestrial_date(epoch_ns, elapsed_s), *utc_date(epoch_ns, elapsed_s))
    return mat3(erfa.c2t06a(*dates, 0.0, 0.0))


@kernel
def advance_dcm_en(dcm_en: Mat3, seconds: float) -> Mat3:
    """Rotation `seconds` later, about the Earth's own z axis; precession (0.14 arcsec a day) is ignored."""
    angle = EARTH_ROTATION_RATE * seconds
    c, s = math.cos(angle), math.sin(angle)
    x, y = dcm_en[0], dcm_en[1]
    return (
        (c * x[0] + s * y[0], c * x[1] + s * y[1], c * x[2] + s * y[2]),
        (c * y[0] - s * x[0], c * y[1] - s * x[1], c * y[2] - s * x[2]),
        dcm_en[2],
    )
