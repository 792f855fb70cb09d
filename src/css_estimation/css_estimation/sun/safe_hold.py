# SPDX-License-Identifier: Apache-2.0
"""What the safe-hold estimators of Benton share: modes, and what stands in for the Sun in the shadow.

In the shadow the cells read noise, so their word is not asked: sun_b becomes [1, 0, 0] with validity none, and a
control that minds validity ignores the attitude. Who decides on the shadow is `eclipse.source`, here by default the
flight's own orbit model. Sunlit without a lit cell, the last heading is held.
"""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.sun.eclipse_detector import EclipseState
from css_estimation.sun.sun_heading import (
    ECLIPSE_SUNLIT,
    NO_COVARIANCE,
    VALIDITY_NONE,
    VALIDITY_VALID,
    Aiding,
    SunHeading,
)
from css_estimation.sun.sun_tracking import Estimate, TrackingParameters, TrackingState, finish_cycle, gyro_usable

DEFAULTS = {"eclipse__source": "model"}
"""What is the default in a safe hold and not elsewhere."""

MODE_NO_SUN = 0
MODE_FLAT = 1
MODE_SHADOW = 2
MODE_PYRAMID = 3
MODE_PYRAMID_DENIED = 4

MODE_NAMES = {
    MODE_NO_SUN: "no Sun",
    MODE_FLAT: "flat cells",
    MODE_SHADOW: "shadow",
    MODE_PYRAMID: "pyramid",
    MODE_PYRAMID_DENIED: "flat cells, which deny the light on the pyramid",
}

_IN_SHADOW: Vec3 = (1.0, 0.0, 0.0)


class CellsVerdict(NamedTuple):
    """What the cells of one cycle say."""

    sun_b: Vec3  # unit vector; zeros without a Sun
    lit_mask: int
    mode: int
    switched: bool  # from other cells than in the cycle before: the two vectors are no pair for a rate


@kernel
def finish_safe_hold(
    p: TrackingParameters,
    state: TrackingState,
    dt: float,
    aiding: Aiding,
    shadow: tuple[EclipseState, int],
    verdict: CellsVerdict,
) -> tuple[TrackingState, SunHeading]:
    """The rest of a cycle.

    Args:
        dt: `elapsed` time [s].
        shadow: result of `detect_eclipse`.
        verdict: of the cells, which does not count in the shadow.
    """
    sun_b, mask, mode, switched = verdict
    in_shadow = shadow[1] != ECLIPSE_SUNLIT
    if in_shadow:
        sun_b, mask, mode = _IN_SHADOW, 0, MODE_SHADOW
    elif mode == MODE_NO_SUN and state.validity != VALIDITY_NONE:
        sun_b = state.sun_b
    valid = mode != MODE_NO_SUN and not in_shadow
    restarted = switched or state.validity != VALIDITY_VALID
    estimate = Estimate(sun_b, NO_COVARIANCE, valid, in_shadow, restarted, 0.0, 0, mask, mode, state.light)
    return finish_cycle(p, state, dt, aiding, gyro_usable(p, aiding), shadow, estimate)
