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
from css_common.vectors import Vec3, norm
from css_estimation.health import aiding_health, cell_health, cell_memory, cell_options, gyroless_sight
from css_estimation.health.aiding_health import (
    AidingHealthMemory,
    AidingHealthParameters,
    AidingHealthState,
    Trusted,
    check_aiding,
)
from css_estimation.health.cell_following import UNEXPLAINED
from css_estimation.health.cell_health import watch_cells
from css_estimation.health.cell_memory import PHASE_LOOKING, CellHealthMemory, CellHealthState, Track
from css_estimation.health.cell_options import ENABLED, CellHealthParameters
from css_estimation.health.cell_search import cost
from css_estimation.health.gyroless_sight import Glimpse, Gyroless, Led, contradicts, follow_gyro, look, waiting
from css_estimation.health.rate_checks import unknown_turn
from css_estimation.sun import heading_dispatch
from css_estimation.sun.sun_heading import RATE_GYRO, RATE_NONE, Aiding, SunHeading
from css_estimation.sun.sun_tracking import USE_GYRO, elapsed
from css_estimation.sun.sunline_cycle import SunlineParameters

PARAMETERS = (ENABLED, *cell_options.PARAMETERS, *aiding_health.PARAMETERS)
NO_VERDICTS = new_verdicts(SORT_CELL, 0)
_cell_parameters = builder(CellHealthParameters)


class AidingWatch(NamedTuple):
    """Gyro and magnetometer, and what they are held against."""

    sight: Gyroless
    led: Led
    health: AidingHealthState


class Watched(NamedTuple):
    """Parameters."""

    sight: SunlineParameters
    led: SunlineParameters
    aiding: AidingHealthParameters
    cells: CellHealthParameters
    use_gyro: bool
    own: Any  # of the algorithm


class WatchedState(NamedTuple):
    """Carried from cycle to cycle."""

    aiding: AidingWatch
    cells: CellHealthState
    omega_bn_b: Vec3  # [rad/s] of the last heading
    rate_source: int  # of that
    own: Any


class WatchedMemory(NamedTuple):
    """Advanced in place."""

    aiding: AidingHealthMemory
    cells: CellHealthMemory
    own: Any


def watched_parameters(algorithm: Any, values: Values) -> Any:
    """Parameters of an algorithm, behind the health of its sensors unless that is switched off."""
    own = algorithm.parameters(values)
    use_gyro = bool(values[USE_GYRO]) if USE_GYRO in values else False
    if not values[ENABLED]:
        return own
    return Watched(
        gyroless_sight.gyroless_parameters(values),
        gyroless_sight.gyro_led_parameters(values),
        aiding_health.parameters(values),
        _cell_parameters(values),
        use_gyro,
        own,
    )


def initial_state(algorithm: Any, p: Any) -> Any:
    """State for parameters of `watched_parameters`."""
    if not isinstance(p, Watched):
        return algorithm.initial_state(p)
    aiding = AidingWatch(
        gyroless_sight.initial_state(p.sight),
        gyroless_sight.initial_led(p.led),
        aiding_health.initial_state(p.aiding),
    )
    return WatchedState(aiding, cell_health.initial_state(), (0.0, 0.0, 0.0), RATE_NONE, algorithm.initial_state(p.own))


def initial_memory(algorithm: Any, p: Any) -> Any:
    """Memory for parameters of `watched_parameters`."""
    if not isinstance(p, Watched):
        return algorithm.initial_memory(p)
    return WatchedMemory(
        aiding_health.initial_memory(p.aiding),
        cell_memory.new_memory(len(p.cells.layout.cells)),
        algorithm.initial_memory(p.own),
    )


def own_of(p: Any, memory: Any) -> tuple[Any, Any]:
    """Parameters and memory of the algorithm itself."""
    return (p.own, memory.own) if isinstance(p, Watched) else (p, memory)


def verdicts_of(memory: Any) -> np.ndarray:
    """Rows of `css_common.health.VERDICT` of a memory of `initial_memory`."""
    if not isinstance(memory, WatchedMemory):
        return NO_VERDICTS
    aiding = memory.aiding
    return np.concatenate((memory.cells.verdicts, aiding.gyro_verdicts, aiding.field_verdicts))


def verdict_changes(memory: Any) -> int:
    """How often verdicts have changed so far."""
    if not isinstance(memory, WatchedMemory):
        return 0
    return int(memory.cells.changes[0] + memory.aiding.changes[0])


@kernel
def _watch_aiding(p, state, memory, dt: float, aiding: Aiding) -> tuple[AidingWatch, Trusted]:
    """Gyro and magnetometer, held against the cells of the last cycle: those of this one are judged with the gyro."""
    dt = elapsed(dt)
    before = state.aiding
    voltages, no_speeds = memory.cells.trusted, memory.aiding.no_speeds
    found = state.cells.track.phase != PHASE_LOOKING
    checks, found_b = p.aiding.gyro.checks, state.cells.track.sun_b
    sight, glimpse = look(p.sight, checks, before.sight, dt, voltages, no_speeds, aiding.sky, found, found_b)
    readings = before.health.gyro.readings
    read = readings.spoken and readings.silent == 0.0
    led = follow_gyro(
        p.led,
        p.cells,
        before.led,
        dt,
        voltages,
        no_speeds,
        aiding.sky,
        readings.rate_b,
        read,
        glimpse,
        p.aiding.gyro.largest_misfit,
        unknown_turn(checks, norm(readings.rate_b), dt),
    )
    # cells that no Sun explains, whatever the gyro says, are no evidence against it
    suspected = led.strikes > 0 or led.misfit > p.aiding.gyro.largest_misfit
    if suspected and glimpse.known and not explains(p.cells, memory.cells, state.cells.track, glimpse):
        led = waiting(led)
    health, trusted = check_aiding(
        p.aiding, before.health, memory.aiding, dt, aiding, glimpse, contradicts(led), p.use_gyro
    )
    return AidingWatch(sight, led, health), trusted


@kernel
def explains(p: CellHealthParameters, memory: CellHealthMemory, track: Track, glimpse: Glimpse) -> bool:
    """Whether the cells that the common direction rests on are explained by the one without gyro."""
    return cost(p, memory.used, glimpse.sun_b, glimpse.covariance, track.light) < UNEXPLAINED


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
def _with_health(said: SunHeading, cells: CellHealthState, sensors_left: int) -> SunHeading:
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
        sensors_left,
    )


# an overload whose annotations are not those of what it stands for is none
def watched_heading(p, state, memory, dt, voltages, aiding):  # noqa: ANN201
    """State and `SunHeading` after a cycle; compiled with who calls it, for each algorithm."""
    watch, t = _watch_aiding(p, state, memory, dt, aiding)
    speeds, sky = aiding.wheel_speeds, aiding.sky
    # here, as kernels hand no arrays back
    aiding = Aiding(t.gyro_b, t.gyro_valid, t.field_b, t.field_valid, speeds, aiding.wheels_valid, sky)
    cells = _watch_sensors(p, state, memory, dt, voltages, aiding)
    own, said = heading_dispatch.estimate_heading(p.own, state.own, memory.own, dt, memory.cells.trusted, aiding)
    return WatchedState(watch, cells, said.omega_bn_b, said.rate_source, own), _with_health(said, cells, t.left)


def stepped_by(step: Callable[..., Any]) -> Callable[..., Any]:
    """What does the same with the `step` of an algorithm whose parameters are of the type of another's."""

    def heading(p: Any, state: Any, memory: Any, dt: float, voltages: np.ndarray, aiding: Aiding) -> Any:
        if not isinstance(p, Watched):
            return step(p, state, memory, dt, voltages, aiding)
        watch, t = _watch_aiding(p, state, memory, dt, aiding)
        speeds, sky = aiding.wheel_speeds, aiding.sky
        # here, as kernels hand no arrays back
        aiding = Aiding(t.gyro_b, t.gyro_valid, t.field_b, t.field_valid, speeds, aiding.wheels_valid, sky)
        cells = _watch_sensors(p, state, memory, dt, voltages, aiding)
        own, said = step(p.own, state.own, memory.own, dt, memory.cells.trusted, aiding)
        return WatchedState(watch, cells, said.omega_bn_b, said.rate_source, own), _with_health(said, cells, t.left)

    return heading
