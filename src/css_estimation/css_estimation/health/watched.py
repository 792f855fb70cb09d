# SPDX-License-Identifier: Apache-2.0
"""A Sun estimator behind the health of its sensors: what fails does not reach it.

`Watched` takes the place of an algorithm's own parameters, state and memory, and `sun.heading_dispatch` calls
`watched_heading` for it: node, replay and Monte Carlo alike. The algorithm knows nothing of it: a cell that is left
out is one whose output is missing.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from css_common.declared import builder
from css_common.health import SORT_CELL, new_verdicts
from css_common.kernel import kernel
from css_common.schema import Values
from css_common.vectors import Vec3
from css_estimation.health import cell_health, cell_memory, cell_options
from css_estimation.health.cell_health import watch_cells
from css_estimation.health.cell_memory import CellHealthMemory, CellHealthState
from css_estimation.health.cell_options import ENABLED, CellHealthParameters
from css_estimation.sun import heading_dispatch
from css_estimation.sun.sun_heading import RATE_GYRO, RATE_NONE, Aiding, SunHeading
from css_estimation.sun.sun_tracking import USE_GYRO, elapsed

PARAMETERS = (ENABLED, *cell_options.PARAMETERS)
NO_VERDICTS = new_verdicts(SORT_CELL, 0)
_cell_parameters = builder(CellHealthParameters)


class Watched(NamedTuple):
    """Parameters."""

    cells: CellHealthParameters
    use_gyro: bool
    own: Any  # of the algorithm


class WatchedState(NamedTuple):
    """Carried from cycle to cycle."""

    cells: CellHealthState
    omega_bn_b: Vec3  # [rad/s] of the last heading
    rate_source: int  # of that
    own: Any


class WatchedMemory(NamedTuple):
    """Advanced in place."""

    cells: CellHealthMemory
    own: Any


def watched_parameters(algorithm: Any, values: Values) -> Any:
    """Parameters of an algorithm, behind the health of its sensors unless that is switched off."""
    own = algorithm.parameters(values)
    use_gyro = bool(values[USE_GYRO]) if USE_GYRO in values else False
    return Watched(_cell_parameters(values), use_gyro, own) if values[ENABLED] else own


def initial_state(algorithm: Any, p: Any) -> Any:
    """State for parameters of `watched_parameters`."""
    if not isinstance(p, Watched):
        return algorithm.initial_state(p)
    return WatchedState(cell_health.initial_state(), (0.0, 0.0, 0.0), RATE_NONE, algorithm.initial_state(p.own))


def initial_memory(algorithm: Any, p: Any) -> Any:
    """Memory for parameters of `watched_parameters`."""
    if not isinstance(p, Watched):
        return algorithm.initial_memory(p)
    return WatchedMemory(cell_memory.new_memory(len(p.cells.layout.cells)), algorithm.initial_memory(p.own))


def verdicts_of(memory: Any) -> np.ndarray:
    """Rows of `css_common.health.VERDICT` of a memory of `initial_memory`."""
    return memory.cells.verdicts if isinstance(memory, WatchedMemory) else NO_VERDICTS


def verdict_changes(memory: Any) -> int:
    """How often verdicts have changed so far."""
    return int(memory.cells.changes[0]) if isinstance(memory, WatchedMemory) else 0


@kernel
def _watch_sensors(p, state, memory, dt: float, voltages, aiding: Aiding) -> CellHealthState:
    gyro_speaks = p.use_gyro and aiding.gyro_valid
    source = RATE_GYRO if gyro_speaks else state.rate_source
    omega_bn_b = aiding.gyro_b if gyro_speaks else state.omega_bn_b
    return watch_cells(
        p.cells,
        state.cells,
        memory.cells,
        elapsed(dt),
        voltages,
        omega_bn_b,
        source,
        aiding.sky,
    )


@kernel
def _with_health(said: SunHeading, cells: CellHealthState) -> SunHeading:
    return SunHeading(
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


def watched_heading(p: Any, state: Any, memory: Any, dt: Any, voltages: Any, aiding: Any) -> Any:
    """State and `SunHeading` after a cycle; compiled with who calls it, for each algorithm."""
    cells = _watch_sensors(p, state, memory, dt, voltages, aiding)
    own, said = heading_dispatch.estimate_heading(p.own, state.own, memory.own, dt, memory.cells.trusted, aiding)
    return WatchedState(cells, said.omega_bn_b, said.rate_source, own), _with_health(said, cells)


def stepped_by(step: Callable[..., Any]) -> Callable[..., Any]:
    """What does the same with the `step` of an algorithm whose parameters are of the type of another's."""

    def heading(p: Any, state: Any, memory: Any, dt: float, voltages: np.ndarray, aiding: Aiding) -> Any:
        if not isinstance(p, Watched):
            return step(p, state, memory, dt, voltages, aiding)
        cells = _watch_sensors(p, state, memory, dt, voltages, aiding)
        own, said = step(p.own, state.own, memory.own, dt, memory.cells.trusted, aiding)
        return WatchedState(cells, said.omega_bn_b, said.rate_source, own), _with_health(said, cells)

    return heading
