# SPDX-License-Identifier: Apache-2.0
"""What estimators share that make each heading of the cells of one cycle alone: gate, and what to do in the dark."""

from typing import NamedTuple

from css_common.declared import computed, given, part
from css_common.kernel import kernel
from css_common.schema import flag
from css_common.vectors import Vec3
from css_estimation.sun.cell_layout import CellLayout, cell_layout
from css_estimation.sun.eclipse_detector import detect_eclipse
from css_estimation.sun.fading import UNKNOWN_TURN, LightNow, light_on
from css_estimation.sun.lit_cells import Gate
from css_estimation.sun.sun_heading import NO_COVARIANCE, VALIDITY_NONE, VALIDITY_VALID, Aiding, Covariance, SunHeading
from css_estimation.sun.sun_tracking import (
    Estimate,
    TrackingParameters,
    TrackingState,
    elapsed,
    finish_cycle,
    gyro_usable,
    turned_sun,
    watch_light,
)

MODE_NO_SUN = 0


class SnapshotParameters(NamedTuple):
    """Part of the parameters of such an estimator."""

    layout: CellLayout = computed(cell_layout)
    gate: Gate = part(Gate)
    propagate_held: bool = given(flag("propagate_held", True, "without Sun, turn the held vector with the gyro"))
    tracking: TrackingParameters = part(TrackingParameters)


class Snapshot(NamedTuple):
    """What the cells of one cycle say."""

    sun_b: Vec3  # unit vector; zeros without a Sun
    covariance: Covariance
    lit_mask: int
    mode: int  # MODE_NO_SUN, or another number that is the estimator's own


@kernel
def finish_snapshot(
    p: SnapshotParameters,
    state: TrackingState,
    dt: float,
    voltages,
    top: int,
    aiding: Aiding,
    snapshot: Snapshot,
) -> tuple[TrackingState, SunHeading]:
    """The rest of a cycle: without a Sun, and while it sets, the last heading is held, or turned with the gyro.

    Args:
        top: result of `brightest`.
        others: as in `css_estimation.sun.sun_heading`.
    """
    dt = elapsed(dt)
    gyro_ok = gyro_usable(p.tracking, aiding)
    lit = snapshot.mode != MODE_NO_SUN
    mask = snapshot.lit_mask
    # one cell alone dims by a turn as by a Sun that sets, and gives no rate by either
    several = mask & (mask - 1) != 0
    share = UNKNOWN_TURN if several else 0.0
    light = LightNow(light_on(p.layout, snapshot.sun_b, voltages, mask) if lit else 0.0, share)
    track, setting = watch_light(p.tracking, state, dt, aiding, lit, light)
    valid = lit and not setting
    sun_b = snapshot.sun_b
    if not valid and state.validity != VALIDITY_NONE:
        sun_b = state.sun_b
        if p.propagate_held and gyro_ok:
            sun_b = turned_sun(sun_b, aiding.gyro_b, dt)
    restarted = state.validity != VALIDITY_VALID
    mode = snapshot.mode if valid else MODE_NO_SUN
    covariance = snapshot.covariance if valid else NO_COVARIANCE
    estimate = Estimate(sun_b, covariance, valid, False, restarted, 0.0, 0, mask if valid else 0, mode, track)
    largest = voltages[top] if top >= 0 else 0.0
    shadow = detect_eclipse(p.tracking.eclipse, state.eclipse, dt, largest, aiding.sky.predicted)
    return finish_cycle(p.tracking, state, dt, aiding, gyro_ok, shadow, estimate)
