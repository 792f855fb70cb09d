# SPDX-License-Identifier: Apache-2.0
"""Quick start of the attitude filter: TRIAD from the field and the Sun, so that it need not begin with a guess.

Three or more lit cells that span space give the Sun. Where the lit normals lie in a plane, two mirrored Suns fit; the
angle between Sun and field, which does not depend on attitude, and the cells that are dark choose one, or none when
they cannot tell. The same angle checks a Sun that the cells give alone.
"""

import math
from typing import NamedTuple

from css_common.kernel import kernel
from css_common.vectors import Mat3, Vec3, add, dot, norm, scale, unit
from css_estimation.attitude.lit_sun_vector import LitSun
from css_estimation.attitude.triad import triad, triad_covariance
from css_estimation.symmetric import Symmetric, isotropic

# A Sun so close to the plane of the normals that its height above it is all error.
_LEAST_HEIGHT = 0.3
_SIGMAS = 4.0


class Start(NamedTuple):
    """An attitude to begin with."""

    found: bool
    dcm_bn: Mat3
    covariance: Symmetric  # of the attitude error [rad^2]


@kernel
def no_start() -> Start:
    """No attitude found."""
    return Start(False, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), isotropic(1.0))


@kernel
def _dark_cells_agree(cells, outputs, mask: int, sun_b: Vec3, least: float) -> bool:
    """No cell that is dark should be well lit by a Sun in direction `sun_b`."""
    for i in range(outputs.shape[0]):
        if mask >> i & 1 == 0 and outputs[i] == outputs[i]:
            cell = cells[i]
            if cell.nx * sun_b[0] + cell.ny * sun_b[1] + cell.nz * sun_b[2] > least:
                return False
    return True


@kernel
def chosen_sun(
    cells, outputs, mask: int, sun: LitSun, cosine: float, direction_b: Vec3, cell_sigma: float, gate: float
) -> tuple[Vec3, float, bool]:
    """Sun, its error [rad] about the worse axis across it, and whether there is one.

    Args:
        outputs: (N,) relative to the Sun at normal incidence.
        mask: lit cells.
        sun: what they say.
        cosine: of the angle between Sun and field, from models.
        direction_b: unit vector of the measured field.
        cell_sigma: error of an output.
        gate: output from which a cell counts as lit.
    """
    least = gate + _SIGMAS * cell_sigma
    if sun.rank == 3:
        sun_b = unit(sun.vector)
        sigma = cell_sigma / math.sqrt(sun.information[2])
        tolerance = _SIGMAS * sigma
        return sun_b, sigma, abs(dot(sun_b, direction_b) - cosine) < tolerance
    nothing = ((0.0, 0.0, 0.0), 0.0, False)
    if sun.rank < 2:
        return nothing
    in_plane = norm(sun.vector)
    if not in_plane < 1.0:
        return nothing
    height = math.sqrt(1.0 - in_plane * in_plane)
    if height < _LEAST_HEIGHT:
        return nothing
    sigma = cell_sigma / (math.sqrt(sun.information[1]) * height)
    tolerance = _SIGMAS * sigma
    above = add(sun.vector, scale(height, sun.axes[2]))
    below = add(sun.vector, scale(-height, sun.axes[2]))
    misfit_above = abs(dot(above, direction_b) - cosine)
    misfit_below = abs(dot(below, direction_b) - cosine)
    fits_above = misfit_above < tolerance and _dark_cells_agree(cells, outputs, mask, above, least)
    fits_below = misfit_below < tolerance and _dark_cells_agree(cells, outputs, mask, below, least)
    if fits_above == fits_below:
        return nothing
    return (above if fits_above else below), sigma, True


@kernel
def start(sun_b: Vec3, sun_sigma: float, sun_n: Vec3, field_b: Vec3, field_sigma: float, field_n: Vec3) -> Start:
    """Attitude from both directions, the more accurate one first.

    Args:
        sun_b, sun_n: unit vectors to the Sun, measured and from a model.
        field_b, field_n: unit vectors of the field.
        sun_sigma, field_sigma: errors about each axis across them [rad].
    """
    if field_sigma <= sun_sigma:
        found, dcm_bn = triad(field_b, sun_b, field_n, sun_n)
        if found:
            return Start(True, dcm_bn, triad_covariance(field_b, sun_b, field_sigma, sun_sigma))
    else:
        found, dcm_bn = triad(sun_b, field_b, sun_n, field_n)
        if found:
            return Start(True, dcm_bn, triad_covariance(sun_b, field_b, sun_sigma, field_sigma))
    return no_start()
