# SPDX-License-Identifier: Apache-2.0
"""The standard normal distribution and its inverse, for kernels."""

import math

from css_common.kernel import kernel

# Coefficients of Wichura's rational approximations, highest power first.
_CENTRE_NUMERATOR = (
    2509.0809287301226727, 33430.575583588128105, 67265.770927008700853, 45921.953931549871457,
    13731.693765509461125, 1971.5909503065514427, 133.14166789178437745, 3.387132872796366608,
)  # fmt: skip
_CENTRE_DENOMINATOR = (
    5226.495278852545925, 28729.085735721942674, 39307.89580009271061, 21213.794301586595867,
    5394.1960214247511077, 687.1870074920579083, 42.313330701600911252, 1.0,
)  # fmt: skip
_MIDDLE_NUMERATOR = (
    7.7454501427834140764e-4, 0.0227238449892691845833, 0.24178072517745061177, 1.27045825245236838258,
    3.64784832476320460504, 5.7694972214606914055, 4.6303378461565452959, 1.42343711074968357734,
)  # fmt: skip
_MIDDLE_DENOMINATOR = (
    1.05075007164441684324e-9, 5.475938084995344946e-4, 0.0151986665636164571966, 0.14810397642748007459,
    0.68976733498510000455, 1.6763848301838038494, 2.05319162663775882187, 1.0,
)  # fmt: skip
_TAIL_NUMERATOR = (
    2.01033439929228813265e-7, 2.71155556874348757815e-5, 0.0012426609473880784386, 0.026532189526576123093,
    0.29656057182850489123, 1.7848265399172913358, 5.4637849111641143699, 6.6579046435011037772,
)  # fmt: skip
_TAIL_DENOMINATOR = (
    2.04426310338993978564e-15, 1.4215117583164458887e-7, 1.8463183175100546818e-5, 7.868691311456132591e-4,
    0.0148753612908506148525, 0.13692988092273580531, 0.59983220655588793769, 1.0,
)  # fmt: skip


# Coefficients of a rational approximation of the share beyond |z| over the density at 0, highest power first.
_BEYOND_NUMERATOR = (
    0.0, 3.52624965998911e-2, 0.700383064443688, 6.37396220353165,
    33.912866078383, 112.079291497871, 221.213596169931, 220.206867912376,
)  # fmt: skip
_BEYOND_DENOMINATOR = (
    8.83883476483184e-2, 1.75566716318264, 16.064177579207, 86.7807322029461,
    296.564248779674, 637.333633378831, 793.826512519948, 440.413735824752,
)  # fmt: skip


@kernel
def _polynomial(coefficients, x: float) -> float:
    value = coefficients[0]
    for i in range(1, 8):
        value = value * x + coefficients[i]
    return value


@kernel
def normal_quantile(p: float) -> float:
    """Inverse of the standard normal distribution, relative error 1e-15 (Wichura 1988, algorithm AS 241)."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _polynomial(_CENTRE_NUMERATOR, r) / _polynomial(_CENTRE_DENOMINATOR, r)
    r = math.sqrt(-math.log(p if q < 0.0 else 1.0 - p))
    if r <= 5.0:
        value = _polynomial(_MIDDLE_NUMERATOR, r - 1.6) / _polynomial(_MIDDLE_DENOMINATOR, r - 1.6)
    else:
        value = _polynomial(_TAIL_NUMERATOR, r - 5.0) / _polynomial(_TAIL_DENOMINATOR, r - 5.0)
    return -value if q < 0.0 else value


@kernel
def normal_share(z: float) -> tuple[float, float]:
    """Share of a standard normal number below z, |z| <= 7, and its density there.

    Absolute error 3e-16; relative 3e-13 from -4 on, 3e-9 at -7. After Hart (1968), number 5666, as West has it (2005,
    "Better approximations to cumulative normal functions"): of the C library it calls `exp` alone, whose bits are the
    same on other processors; those of `erf` are not.
    """
    away = abs(z)
    falling = math.exp(-0.5 * z * z)
    beyond = falling * _polynomial(_BEYOND_NUMERATOR, away) / _polynomial(_BEYOND_DENOMINATOR, away)
    return (1.0 - beyond if z > 0.0 else beyond), falling / math.sqrt(2.0 * math.pi)
