# SPDX-License-Identifier: Apache-2.0
"""A Sun estimator behind the health of its sensors: what fails does not reach it.

`Watched` takes the place of an algorithm's own parameters, state and memory, and `sun.heading_dispatch` calls
`watched_heading` for it: node, replay and Monte Carlo alike. The algorithm knows nothing of it: a cell that is left
out is one whose output is missing.
"""

from typing import Any, NamedTuple

from css_common.declared import builder
from css_common.schema import Values
from css_common.vectors import Vec3
from css_estimation.health import cell_health, cell_memory, cell_options
from css_estimation.health.cell_health import watch_cells
from css_estimation.health.cell_memory import CellHealthMemory, CellHealthState
from css_estimation.health.cell_options import ENABLED, CellHealthParameters
from css_estimation.sun import heading_dispatch
from css_estimation.sun.sun_heading import RATE_NONE, SunHeading
from css_estimation.sun.sun_tracking import elapsed

PARAMETERS = (ENABLED, *cell_options.PARAMETERS)
_cell_parameters = builder(CellHealthParameters)


class Watched(NamedTuple):
    """Parameters."""

    cells: CellHealthParameters
    own: Any  # of the algorithm


class WatchedState(NamedTuple):
    """Carried from cycle to cycle."""

    cells: CellHealthState
    omega_bn_b: Vec3  # [rad/s] of the last heading
    rate_known: bool
    own: Any


class WatchedMemory(NamedTuple):
    """Advanced in place."""

    cells: CellHealthMemory
    own: Any


def watched_parameters(algorithm: Any, values: Values) -> Any:
    """Parameters of an algorithm, behind the health of its sensors unless that is switched off."""
    own = algorithm.parameters(values)
    return Watched(_cell_parameters(values), own) if values[ENABLED] else own


def initial_state(algorithm: Any, p: Any) -> Any:
    """State for parameters of `watched_parameters`."""
    if not isinstance(p, Watched):
        return algorithm.initial_state(p)
    return WatchedState(cell_health.initial_state(), (0.0, 0.0, 0.0), False, algorithm.initial_state(p.own))


def initial_memory(algorithm: Any, p: Any) -> Any:
    """Memory for parameters of `watched_parameters`."""
    if not isinstance(p, Watched):
        return algorithm.initial_memory(p)
    return WatchedMemory(cell_memory.new_memory(len(p.cells.layout.cells)), algorithm.initial_memory(p.own))


def watched_heading(p, state, memory, dt, voltages, aiding):
    """State and `SunHeading` after a cycle; compiled with who calls it, for each algorithm."""
    gyro_speaks = aiding.gyro_valid
    omega_bn_b = aiding.gyro_b if gyro_speaks else state.omega_bn_b
    cells = watch_cells(
        p.cells,
        state.cells,
        memory.cells,
        elapsed(dt),
        voltages,
        omega_bn_b,
        gyro_speaks or state.rate_known,
        aiding.sky,
    )
    own, said = heading_dispatch.estimate_heading(p.own, state.own, memory.own, dt, memory.cells.trusted, aiding)
    heading = SunHeading(
        said.sun_b,
        said.covariance,
        said.omega_bn_b,
        said.age,
        said.nis,
        said.nis_dof,
        said.lit_mask,
        said.validity,
        said.rate_source,
        said.eclipse,
        said.mode,
        cells.isolated,
        0,
    )
    return WatchedState(cells, said.omega_bn_b, said.rate_source != RATE_NONE, own), heading
