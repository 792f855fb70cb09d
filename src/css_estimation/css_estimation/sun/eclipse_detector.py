# SPDX-License-Identifier: Apache-2.0
"""Is the spacecraft in the Earth's shadow? From the cells, from an orbit model, or from both agreeing.

The cells alone decide with hysteresis in level and time: darkness begins an eclipse when the brightest cell
stays below `dark_level` for `dark_time`, light ends it when it stays above `lit_level` for `lit_time`. In
between the verdict stands. Cells can also go dark because they fail or because the layout has holes; an
orbit model can be wrong by its ephemeris. With `both`, an eclipse needs the two to agree. With `flag` the spacecraft
says it by means of its own, such as the current of its panels; while it says nothing the cells decide.
"""

from typing import NamedTuple

from css_common.declared import builder, given, made, table_of
from css_common.kernel import kernel
from css_common.schema import choice, real
from css_estimation.sun.sun_heading import (
    ECLIPSE_ECLIPSED,
    ECLIPSE_SUNLIT,
    PREDICTION_ECLIPSED,
    PREDICTION_UNKNOWN,
    Sky,
)

_SOURCES = {"sensors": 0, "model": 1, "both": 2, "flag": 1}  # a flag has the word as a model has
_MODEL = _SOURCES["model"]
_SENSORS = _SOURCES["sensors"]

SOURCE = choice(
    "eclipse.source",
    "sensors",
    tuple(_SOURCES),
    "who decides on eclipse; both: the two must agree; flag: the spacecraft, by `sunlight/illuminance`",
)


class EclipseParameters(NamedTuple):
    """Levels relative to the normal Sun, times in seconds."""

    source: int = made(_SOURCES.__getitem__, SOURCE)
    dark_level: float = given(
        real("eclipse.dark_level", 0.12, "-", "brightest output below which it is dark", low=0.0, high=1.0)
    )
    dark_time: float = given(real("eclipse.dark_time", 10.0, "s", "darkness that begins an eclipse", low=0.0, high=1e4))
    lit_level: float = given(
        real("eclipse.lit_level", 0.3, "-", "brightest output above which it is light", low=0.0, high=1.0)
    )
    lit_time: float = given(real("eclipse.lit_time", 5.0, "s", "light that ends an eclipse", low=0.0, high=1e4))


PARAMETERS = table_of(EclipseParameters)
parameters = builder(EclipseParameters)


class EclipseState(NamedTuple):
    """Verdict of the cells and how long the opposite has been seen."""

    sensed: int  # ECLIPSE_*
    contrary_time: float  # [s]


def initial_state() -> EclipseState:
    """Sunlit until the cells have been dark for long enough."""
    return EclipseState(ECLIPSE_SUNLIT, 0.0)


@kernel
def goes_by_model(p: EclipseParameters, sky: Sky) -> bool:
    """Whether the orbit model alone has the word, and there is one."""
    return p.source == _MODEL and sky.known


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
    new_state = EclipseState(sensed, contrary_time)

    if p.source == _SENSORS or predicted == PREDICTION_UNKNOWN:
        return new_state, sensed
    modelled = ECLIPSE_ECLIPSED if predicted == PREDICTION_ECLIPSED else ECLIPSE_SUNLIT
    if p.source == _MODEL:
        return new_state, modelled
    if sensed == ECLIPSE_ECLIPSED and modelled == ECLIPSE_ECLIPSED:
        return new_state, ECLIPSE_ECLIPSED
    return new_state, ECLIPSE_SUNLIT
