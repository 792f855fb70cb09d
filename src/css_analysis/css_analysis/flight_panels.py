# SPDX-License-Identifier: Apache-2.0
"""The panels that show a flight against time; `css_analysis.flight_figures` arranges and writes them."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from css_analysis.estimate_errors import attitude_errors, heading_errors
from css_analysis.figure_style import (
    BLACK,
    BLUE,
    Colour,
    colours,
    draw_series,
    legend,
    level_line,
    logarithmic,
    shade_dark,
)
from css_analysis.flight_log import FlightLog
from css_analysis.flight_series import (
    MODES,
    RPM,
    TimeAxis,
    dark_times,
    error_series,
    estimator_label,
)
from css_analysis.health_panel import draw_health
from css_analysis.unit_spells import has_spells
from css_common.message_columns import Columns


def shade_eclipse(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    """Grey background where the flight is not sunlit; without truth, where an estimator says so."""
    shaded = dark_times(log)
    if shaded is not None:
        time_s, dark = shaded
        shade_dark(axes, time_s / unit.scale, dark)


def draw_heading_error(axes: Axes, log: FlightLog, unit: TimeAxis, name: str, colour: Colour, label: str) -> None:
    """Angle of estimated to true Sun; a stretch of steps without estimate is a gap in the line."""
    steps, errors = heading_errors(log, name)
    _draw_errors(axes, log, unit, steps, errors, colour, label)


def _draw_errors(axes, log: FlightLog, unit: TimeAxis, steps, errors, colour: Colour, label: str) -> None:
    time_s, degrees = error_series(log, steps, errors)
    draw_series(axes, time_s / unit.scale, degrees, colour, label)


def draw_pointing_error(axes: Axes, log: FlightLog, unit: TimeAxis, colour: Colour, label: str = "") -> None:
    """Angle of array normal to true Sun."""
    draw_series(axes, log.time(log.having("truth")) / unit.scale, np.degrees(log.pointing_error), colour, label)


def draw_true_rate(axes: Axes, log: FlightLog, unit: TimeAxis, colour: Colour, label: str) -> None:
    """Norm of the true body rate."""
    draw_series(axes, log.time(log.having("truth")) / unit.scale, np.degrees(log.rate), colour, label)


def finish_heading_error(axes: Axes) -> None:
    """Axis of heading errors."""
    logarithmic(axes)
    axes.set_ylabel("angle [deg]")
    legend(axes)


def finish_pointing_error(axes: Axes) -> None:
    """Axis of pointing errors, with the angles that matter: power positive, and the deadband of the paper."""
    level_line(axes, 30.0, "30°, power positive")
    level_line(axes, 15.0, "15°")
    axes.set_ylim(0.0, max(45.0, axes.get_ylim()[1]))
    axes.set_ylabel("angle [deg]")


def finish_rate(axes: Axes) -> None:
    """Axis of body rates."""
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("rate [deg/s]")
    legend(axes)


def _heading_error(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    for name, colour in zip(log.estimates, colours(len(log.estimates)), strict=True):
        draw_heading_error(axes, log, unit, name, colour, estimator_label(log, name))
    finish_heading_error(axes)


def _attitude_error(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    for name, colour in zip(log.attitudes, colours(len(log.attitudes)), strict=True):
        steps, errors, _ = attitude_errors(log, name)
        _draw_errors(axes, log, unit, steps, errors, colour, name)
    finish_heading_error(axes)


def _pointing_error(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    draw_pointing_error(axes, log, unit, BLACK)
    finish_pointing_error(axes)


def _body_rate(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    estimates = log.estimates | log.attitudes
    for (name, columns), colour in zip(estimates.items(), colours(len(estimates)), strict=True):
        rate = np.degrees(np.linalg.norm(columns.omega_bn_b, axis=1))
        draw_series(axes, log.time(columns) / unit.scale, rate, colour, f"estimated by {name}")
    if log.knows("rate"):
        draw_true_rate(axes, log, unit, BLACK, "true")
    finish_rate(axes)


def _wheel_speed(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    wheels = log.having("wheels")
    _draw_all(axes, log, unit, wheels, wheels.speed * RPM)
    axes.set_ylabel("speed [rpm]")
    legend(axes, title="wheel")


def _cell_output(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    cells = log.having("voltages")
    outputs = cells.voltages
    _draw_all(axes, log, unit, cells, outputs)
    axes.set_ylim(bottom=min(0.0, float(np.nanmin(outputs))))
    axes.set_ylabel("output [-]")
    legend(axes, title="cell")


def _draw_all(axes: Axes, log: FlightLog, unit: TimeAxis, columns: Columns, values: np.ndarray) -> None:
    time = log.time(columns) / unit.scale
    for i, colour in enumerate(colours(values.shape[1])):
        draw_series(axes, time, values[:, i], colour, f"{i}")


def _control_mode(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    control = log.having("control")
    modes = control.mode
    # only the corners of the staircase are drawn
    turns = np.flatnonzero(np.diff(modes)) + 1
    corners = np.unique(np.concatenate(([0], turns - 1, turns, [len(modes) - 1])))
    axes.step(log.time(control)[corners] / unit.scale, modes[corners], where="post", color=BLUE)
    axes.set_yticks(list(MODES), list(MODES.values()))
    axes.set_ylim(-0.5, len(MODES) - 0.5)


def _health(axes: Axes, log: FlightLog, unit: TimeAxis) -> None:
    draw_health(axes, log, unit.scale, unit.last)
    legend(axes, title="held for failed by")


class Panel(NamedTuple):
    """One set of axes."""

    name: str  # of its file
    title: str
    height: float  # relative to the others in the overview
    draw: Callable[[Axes, FlightLog, TimeAxis], None]


_HEADING_ERROR = Panel("heading_error", "Estimated to true Sun", 1.3, _heading_error)
_ATTITUDE_ERROR = Panel("attitude_error", "Estimated to true attitude", 1.3, _attitude_error)
_POINTING_ERROR = Panel("pointing_error", "Array normal to true Sun", 1.0, _pointing_error)
_BODY_RATE = Panel("body_rate", "Body rate", 1.0, _body_rate)
_CONTROL_MODE = Panel("control_mode", "Control mode", 0.8, _control_mode)
_WHEEL_SPEED = Panel("wheel_speed", "Wheel speed", 1.0, _wheel_speed)
_CELL_OUTPUT = Panel("cell_output", "Cell output", 1.2, _cell_output)

_HEALTH = Panel("health", "Units that fail, and that are held for failed", 1.0, _health)


def panels_of(log: FlightLog) -> list[Panel]:
    """The panels for which the flight has data, from top to bottom."""
    has_truth, has_estimates = log.truth is not None, bool(log.estimates)
    chosen = {
        _HEADING_ERROR: has_truth and has_estimates,
        _ATTITUDE_ERROR: log.knows("attitude") and bool(log.attitudes),
        _POINTING_ERROR: has_truth and not log.imported,
        _BODY_RATE: log.knows("rate") or has_estimates or bool(log.attitudes),
        _CONTROL_MODE: log.control is not None,
        _WHEEL_SPEED: log.wheels is not None,
        _CELL_OUTPUT: log.voltages is not None,
        _HEALTH: has_spells(log),
    }
    return [panel for panel, has_data in chosen.items() if has_data]
