# SPDX-License-Identifier: Apache-2.0
"""Outputs that fade together are a Sun that sets, not a body that turns."""

from css_common.kernel import kernel
from css_common.vectors import Vec3, multiply
from css_estimation.sun_filter.cell_model import light_of, view_of
from css_estimation.sun_filter.cell_update import READABLE
from css_estimation.sun_filter.memory import SCALE, X_SCALE, dcm_of, forget
from css_estimation.sun_filter.options import SunFilterParameters
from css_estimation.sun_filter.response import respond

# Part of the expected output below which the Sun is setting.
_FADED = 0.88
# Part above which it has risen again.
_RISEN = 0.96
# A penumbra is over within minutes on any orbit of the Earth below the Moon's; what lasts longer is another intensity.
_LASTING = 120.0  # [s]
_MARGIN = 0.1  # in cosines
_OTHER_SCALE = 0.3**2


@kernel
def part_of_expected(p: SunFilterParameters, x, sun_n: Vec3, flux: float, voltages) -> float:
    """Outputs of the cells that see the Sun, by least squares relative to what is expected of them.

    1 without any, and where a cell that does not see it is brighter than an Earth makes it: there is the Sun.
    """
    sun_b = multiply(dcm_of(x), sun_n)
    both = squares = 0.0
    for i in range(voltages.shape[0]):
        cosine, seen, doubtful = view_of(p, i, sun_b, _MARGIN)
        if doubtful or not abs(voltages[i]) < READABLE:
            continue
        if seen:
            cell = p.cells[i]
            output, _ = respond(p.response, flux * max(cosine, 0.0))
            expected = cell.gain * p.response.scale * (1.0 + x[X_SCALE]) * output
            both += expected * (voltages[i] - cell.dark)
            squares += expected * expected
        elif light_of(p, i, voltages[i]) > p.earth.largest * flux:
            return 1.0
    return both / squares if squares > 0.0 else 1.0


@kernel
def fading(p: SunFilterParameters, x, covariance, sun_n: Vec3, flux: float, voltages, faded: float, dt: float) -> float:
    """How long [s] outputs have been too low, 0 while they are as expected.

    What lasts is taken for another intensity, of which the filter then learns.
    """
    part = part_of_expected(p, x, sun_n, flux, voltages)
    if part > (_RISEN if faded > 0.0 else _FADED):
        return 0.0
    if faded + dt > _LASTING:
        x[X_SCALE] = part * (1.0 + x[X_SCALE]) - 1.0
        forget(covariance, SCALE, 1, _OTHER_SCALE)
        return 0.0
    return faded + dt
