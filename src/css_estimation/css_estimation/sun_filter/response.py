# SPDX-License-Identifier: Apache-2.0
"""Output of a cell over the light on it, with its slope."""

from css_common.kernel import kernel
from css_estimation.sun_filter.options import Response

_COSINE, _OKEEFE = 0, 1


@kernel
def respond(p: Response, light: float) -> tuple[float, float]:
    """Output [-] and its derivative by the light [-], 1 being the Sun at normal incidence at 1 AU."""
    if p.curve == _COSINE:
        return light, 1.0
    if p.curve == _OKEEFE:
        # V (1 + b^2 / 2 - 0.65 b^4) with b^2 = 1 - V^2 (O'Keefe & Schaub 2013, Eq. 16)
        if light <= 0.0:
            return 0.85 * light, 0.85
        if light >= 1.0:
            return light, 1.0
        b2 = 1.0 - light * light
        factor = 1.0 + b2 * (0.5 - 0.65 * b2)
        return light * factor, factor - 2.0 * light * light * (0.5 - 1.3 * b2)
    steps = p.table.shape[0] - 1
    if steps < 1:
        return light, 1.0
    k = min(max(int(light * steps), 0), steps - 1)
    slope = (p.table[k + 1] - p.table[k]) * steps
    return p.table[k] + slope * (light - k / steps), slope
