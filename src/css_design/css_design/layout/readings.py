# SPDX-License-Identifier: Apache-2.0
"""What cells read in each scene: Sun and Earth through the signal chain that flies, without noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from css_common.kernel import outer_kernel
from css_common.random_streams import RandomKey, random_key
from css_common.vectors import mat3, row
from css_design.layout.scenes import Scenes
from css_environment.albedo import albedo_output, is_blocked, new_workspace, transmission, view_cosine
from css_environment.earth_light import aligned_rows
from css_sim.fault_effects import FAULT
from css_sim.sun_cells import SunCells, sample


class Cells(NamedTuple):
    """Cells that are laid out."""

    normals_b: np.ndarray  # (N, 3)
    views_deg: np.ndarray  # (N,) full cones of view

    @property
    def number(self) -> int:
        """How many."""
        return len(self.views_deg)

    def chosen(self, numbers: Sequence[int]) -> "Cells":
        """Some of them."""
        return Cells(self.normals_b[list(numbers)], self.views_deg[list(numbers)])


class Readings(NamedTuple):
    """Of K cells in S scenes.

    Attributes:
        seen: (K, S) whether the Sun is in view.
        outputs: (K, S) readings [-].
    """

    seen: np.ndarray
    outputs: np.ndarray


def read_cells(chain: SunCells, cells: np.ndarray, scenes: Scenes, earthlit: bool) -> Readings:
    """Readings of cells (K,) of `css_sim.cell_errors.CELL` without noise.

    Args:
        chain: their signal chain, without noise and losses drawn at every step.
        earthlit: the Earth lights them.
    """
    result = Readings(np.zeros((len(cells), len(scenes.place)), np.bool_), np.zeros((len(cells), len(scenes.place))))
    lights = np.stack([_aligned(light) for light in scenes.lights])
    _read(
        chain,
        cells,
        np.zeros(0, FAULT),
        random_key(0, 0),
        scenes.suns_b,
        scenes.dcm_bn,
        scenes.place,
        lights,
        scenes.flux,
        earthlit,
        new_workspace(),
        result.seen,
        result.outputs,
    )
    return result


def _aligned(light: np.ndarray) -> np.ndarray:
    room = aligned_rows(6)
    room[:] = light
    return room


@outer_kernel
def _read(
    chain: SunCells,
    cells,
    no_faults,
    key: RandomKey,
    suns_b,
    dcm_bn,
    place,
    lights,
    flux,
    earthlit: bool,
    work,
    seen_out,
    outputs_out,
) -> None:
    count = cells.shape[0]
    albedo, voltages = np.zeros(count), np.zeros(count)
    for s in range(place.shape[0]):
        sun_b, at = row(suns_b, s), place[s]
        if earthlit:
            albedo_output(lights[at], cells, chain.screen, chain.cos_half_view, mat3(dcm_bn[s]), work, albedo)
        sample(chain, cells, no_faults, key, 0, sun_b, flux[at], albedo, voltages)
        for i in range(count):
            cell = cells[i]
            cosine = cell.nx * sun_b[0] + cell.ny * sun_b[1] + cell.nz * sun_b[2]
            sees = cosine > 0.0 and cosine >= view_cosine(chain.screen, i, chain.cos_half_view)
            sees = sees and not is_blocked(chain.screen, i, sun_b)
            seen_out[i, s] = sees and transmission(chain.screen, cell.side, sun_b) > 0.5
            outputs_out[i, s] = voltages[i]
