# SPDX-License-Identifier: Apache-2.0
"""Is the spacecraft in the Earth's shadow? From the cells, from an orbit model, or from both agreeing.

The cells alone decide with hysteresis in level and time: darkness begins an eclipse when the brightest cell
stays below `dark_level` for `dark_time`, light ends it when it stays above `lit_level` for `lit_time`. In
between the verdict stands. Cells can also go dark because they fail; an orbit model can be wrong by its ephemeris.
With `both`, an eclipse needs the two to agree. With `flag` the spacecraft says it by means of its own, such as the
current of its panels; while it says nothing the cells decide.

Cells of a layout with holes are dark as well when the Sun is in one, and a spacecraft that rests because it is night
would rest for ever. Their darkness is an eclipse only if the orbit model has one too; without a model only once they
have been lit, and no longer than `longest`.
"""

from typing import NamedTuple

from css_common.declared import builder, computed, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import Values, choice, real
from css_estimation.sun.cell_layout import cell_layout, sees_all
from css_estimation.sun.sun_heading import (
    ECLIPSE_ECLIPSED,
    ECLIPSE_SUNLIT,
    PREDICTION_ECLIPSED,
    PREDICTION_UNKNOWN,
    Sky,
)
from css_sensors.cells import NORMALS

_SOURCES = {"sensors": 0, "model": 1, "both": 2, "flag": 1}  # a flag has the word as a model has
_MODEL = _SOURCES["model"]
_SENSORS = _SOURCES["sensors"]

SOURCE = choice(
    "eclipse.source",
    "sensors",
    tuple(_SOURCES),
    "who decides on eclipse; both: the two must agree; flag: the spacecraft, by `sunlight/illuminance`",
)


_DARK_LEVEL = real("eclipse.dark_level", 0.12, "-", "brightest output below which it is dark", low=0.0, high=1.0)
_DIRECTIONS = 2000  # 4.5 deg from one to the next
_ALL_CELLS = 2**32 - 1  # mask


def _sees_all(values: Values) -> bool:
    """Whether the Sun lights a cell of the mission above `dark_level` wherever it stands."""
    if NORMALS not in values or not len(values[NORMALS]):
        return True
    return bool(sees_all(cell_layout(values), _ALL_CELLS, values[_DARK_LEVEL], _DIRECTIONS))


class EclipseParameters(NamedTuple):
    """Levels relative to the normal Sun, times in seconds."""

    source: int = made(_SOURCES.__getitem__, SOURCE)
    dark_level: float = given(_DARK_LEVEL)
    dark_time: float = given(real("eclipse.dark_time", 10.0, "s", "darkness that begins an eclipse", low=0.0, high=1e4))
    lit_level: float = given(
        real("eclipse.lit_level", 0.3, "-", "brightest output above which it is light", low=0.0, high=1.0)
    )
    lit_time: float = given(real("eclipse.lit_time", 5.0, "s", "light that ends an eclipse", low=0.0, high=1e4))
    longest: float = given(
        real(
            "eclipse.longest",
            2400.0,
            "s",
            "by cells that do not see all of the sky, and without a model, the longest darkness that is an eclipse",
            low=0.0,
            high=1e6,
        )
    )
    sees_all: bool = computed(_sees_all)


PARAMETERS = table_of(EclipseParameters)
parameters = builder(EclipseParameters)


class EclipseState(NamedTuple):
    """Verdict of the cells and how long the opposite has been seen."""

    sensed: int  # ECLIPSE_*
    contrary_time: float  # [s]
    been_lit: bool  # the brightest cell has been above `lit_level`
    dark_time: float  # [s] for which the verdict has been an eclipse


def initial_state() -> EclipseState:
    """Sunlit until the cells have been dark for long enough."""
    return EclipseState(ECLIPSE_SUNLIT, 0.0, False, 0.0)


@kernel
def goes_by_model(p: EclipseParameters, sky: Sky) -> bool:
    """Whether the orbit model alone has the word, and there is one."""
    return p.source == _MODEL and sky.known


@kernel
def _may_be_night(p: EclipseParameters, state: EclipseState, predicted: int) -> bool:
    """Whether the darkness of cells that do not see all of the sky is an eclipse."""
    if predicted == PREDICTION_UNKNOWN:
        return state.been_lit and state.dark_time <= p.longest
    return predicted == PREDICTION_ECLIPSED


@kernel
def detect_eclipse(
    p: EclipseParameters, state: EclipseState, dt: float, largest: float, predicted: int
) -> tuple[EclipseState, int]:
    """One step: new state and verdict (`ECLIPSE_*`).

    Args:
        dt: time since the last step [s].
        largest: output of the brightest cell [-].
        predicted: `PREDICTION_*` of the orbit model; unknown leaves the verdict to the cells.
    """
    sensed = state.sensed
    contrary_time = 0.0
    if sensed == ECLIPSE_SUNLIT:
        if largest < p.dark_level:
            contrary_time = state.contrary_time + dt
            if contrary_time > p.dark_time:
                sensed, contrary_time = ECLIPSE_ECLIPSED, 0.0
    elif largest > p.lit_level:
        contrary_time = state.contrary_time + dt
        if contrary_time > p.lit_time:
            sensed, contrary_time = ECLIPSE_SUNLIT, 0.0
    dark_time = state.dark_time + dt if sensed == ECLIPSE_ECLIPSED else 0.0
    new_state = EclipseState(sensed, contrary_time, state.been_lit or largest > p.lit_level, dark_time)
    if sensed == ECLIPSE_ECLIPSED and not p.sees_all and not _may_be_night(p, new_state, predicted):
        sensed = ECLIPSE_SUNLIT

    if p.source == _SENSORS or predicted == PREDICTION_UNKNOWN:
        return new_state, sensed
    modelled = ECLIPSE_ECLIPSED if predicted == PREDICTION_ECLIPSED else ECLIPSE_SUNLIT
    if p.source == _MODEL:
        return new_state, modelled
    if sensed == ECLIPSE_ECLIPSED and modelled == ECLIPSE_ECLIPSED:
        return new_state, ECLIPSE_ECLIPSED
    return new_state, ECLIPSE_SUNLIT
