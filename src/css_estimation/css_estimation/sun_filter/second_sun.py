# SPDX-License-Identifier: Apache-2.0
"""The Sun filter beside the other Sun that its cells leave, for as long as it does not know the Earth.

The other one is followed as `ekf` does it (`sun.other_sun`), beside the heading with its error as it is reported.
While the two are apart the turn about the Sun line is not looked for, which might be the wrong one. If the other one
turns out to be right the filter begins anew from there.

What decides has to be fair. The other Sun follows the outputs and makes up for light that cells have lost by its
direction, where the filter holds on to its own; the estimate is therefore judged with the light that it finds.
"""

from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Vec3
from css_estimation.sun.cell_layout import brightest
from css_estimation.sun.fading import light_on
from css_estimation.sun.left_open import surely_spans_space
from css_estimation.sun.other_sun import Followed, OtherSun, follow_other, no_other_sun, with_other
from css_estimation.sun.sun_heading import Aiding, Covariance
from css_estimation.sun_filter.cell_model import light_of
from css_estimation.sun_filter.cell_update import CellReading, bit_count
from css_estimation.sun_filter.filter_state import NO_RATE, Cycle, SunFilterState
from css_estimation.sun_filter.hypotheses import begin
from css_estimation.sun_filter.memory import SunFilterMemory
from css_estimation.sun_filter.motion import RATE_BY_GYRO
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.reported import LARGEST
from css_estimation.sun_filter.reported import heading as heading_of
from css_estimation.symmetric import at_most, of_row_major, scaled, trace

_LEAST_LIGHT = 0.5
# [rad2/s] How fast the other Sun drifts where a gyro tells how the body turns, and where its own motion would have to.
_DRIFT, _DRIFT_WITHOUT_RATE = 0.01**2, 0.1**2


class Beside(NamedTuple):
    """What a cycle comes to."""

    other: OtherSun
    taken: bool  # the filter has begun anew, from the other Sun
    sun_b: Vec3
    covariance: Covariance  # to report


@kernel
def _write_sunlight(p: SunFilterParameters, voltages, sunlight) -> None:
    """Outputs less the mean light of an unknown Earth, 1 being the Sun at normal incidence."""
    for i in range(voltages.shape[0]):
        sunlight[i] = light_of(p, i, voltages[i]) - 0.5 * p.earth.unknown


@kernel
def _turning(state: SunFilterState, cycle: Cycle, reading: CellReading, aiding: Aiding) -> tuple[Vec3, float]:
    """Rate [rad/s] at which both Suns are taken to turn in b, and how fast they drift off that [rad2/s]."""
    if cycle.model == RATE_BY_GYRO:
        return aiding.gyro_b, _DRIFT
    # without gyro the rate is that of the estimate: in the light of the other Sun the body turns otherwise
    if reading.used == 0:
        return state.rate.omega_bn_b, _DRIFT
    return NO_RATE, _DRIFT_WITHOUT_RATE


@kernel
def _misfit(reading: CellReading, spans: bool) -> float:
    """Factor by which innovations are larger than the filter expects, squared; 1 at least.

    A cell that is refused is wrong if the others agree on a direction. If they leave one open the estimate may be.

    Args:
        spans: the cells in use span space.
    """
    squares, count = reading.nis, reading.nis_dof
    if not spans:
        squares, count = squares + reading.against, count + bit_count(reading.refused)
    return max(1.0, squares / max(1, count))


@kernel
def look_beside(
    p: SunFilterParameters,
    state: SunFilterState,
    m: SunFilterMemory,
    sun_b: Vec3,
    covariance: Covariance,
    reading: CellReading,
    cycle: Cycle,
    voltages,
    aiding: Aiding,
) -> Beside:
    """Heading and covariance of a cycle beside the other Sun, and that one after it.

    Args:
        state: after the cycle before.
        sun_b, covariance: of the filter, with the error that the Earth makes.
        reading: of this cycle.
    """
    spans = surely_spans_space(p.cells, reading.used)
    misfit = _misfit(reading, spans)
    if spans and misfit == 1.0 and not state.other.alive:
        # cells that span space and read what is expected leave no other Sun
        return Beside(no_other_sun(), False, sun_b, covariance)
    own = at_most(scaled(of_row_major(covariance), misfit), LARGEST)
    _write_sunlight(p, voltages, m.sunlight)
    rate_b, drift = _turning(state, cycle, reading, aiding)
    variance = p.errors.noise + p.errors.scale + p.errors.cell + p.earth.unknown**2
    light = light_on(p.layout, sun_b, m.sunlight, reading.used)
    light = min(max(light, _LEAST_LIGHT), 1.0) if light > 0.0 else 1.0
    f = Followed(p.layout, p.gate, variance, sun_b, own, reading.used, rate_b, drift, light)
    other, taken = follow_other(f, state.other, cycle.dt, m.sunlight, brightest(m.sunlight))
    if taken:
        begin(p, m, other.sun_b, trace(other.covariance), aiding.sky.sun_n, cycle.model, cycle.wheels_b)
        sun_b, covariance = heading_of(p, m, aiding.sky.sun_n, False, reading.used)
        return Beside(no_other_sun(), True, sun_b, covariance)
    return Beside(other, False, sun_b, with_other(other, sun_b, own, LARGEST))
