# SPDX-License-Identifier: Apache-2.0
"""Where the Sun is, geometrically: light time and aberration (20 arcsec) are beyond what a cell resolves."""

import erfa
import numpy as np

from css_environment.constants import ASTRONOMICAL_UNIT
from css_environment.time_scales import terrestrial_date


def sun_positions(epoch_ns: int, elapsed_s) -> np.ndarray:
    """Sun relative to the centre of the Earth [m] in n, (T, 3), at (T,) seconds after the epoch (UTC, ns).

    ERFA epv00 (VSOP2000 fit, valid 1900 to 2100): within 0.01 arcsec and 10 km of the JPL ephemerides.
    """
    heliocentric, _ = erfa.epv00(*terrestrial_date(epoch_ns, np.atleast_1d(elapsed_s)))
    return -ASTRONOMICAL_UNIT * heliocentric["p"]
