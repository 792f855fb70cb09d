# SPDX-License-Identifier: Apache-2.0
"""A flight against time: errors and their bounds, consistency, rates, actuators, modes."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from css_analysis.estimate_errors import (
    attitude_errors,
    attitude_sigmas,
    heading_errors,
    heading_sigmas,
    tangent_nees,
)
from css_analysis.flight_log import FlightLog
from css_analysis.flight_series import (
    MODES,
    RPM,
    TimeAxis,
    dark_times,
    error_series,
    estimator_label,
    time_axis,
)
from css_common.message_columns import Columns
from css_msgs.msg import ControlStatus
from css_report.blocks import Plot
from css_report.looks import TRUE, Look, look
from css_report.traces import ECLIPSE_ENTRY, Trace, dots, level, line, shaded

LINKED = "time"
"""Word of plots that show the same stretch of a flight."""
_BOUND = "3 sigma it claims"
_WINDOW_S = 60.0  # of running means
_AXES = "xyz"
_LOG = {"type": "log", "tickformat": "~g", "dtick": 1, "minor": {"showgrid": False}}


class Scene(NamedTuple):
    """What all plots of one flight have in common."""

    log: FlightLog
    unit: TimeAxis
    shapes: list[Trace]  # eclipses
    linked: str = LINKED

    def time(self, columns: Columns) -> np.ndarray:
        """Times of rows, in the unit of the abscissa."""
        return self.log.time(columns) / self.unit.scale

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, in the unit of the abscissa."""
        return self.unit.first, self.unit.last

    def plot(self, key: str, title: str, y_label: str, traces: list[Trace], **more) -> Plot:
        """A plot against time."""
        first, last = self.span
        x = {"range": [first, last]} if last > first else {}
        legend = [*more.pop("legend", ()), *([ECLIPSE_ENTRY] if self.shapes else [])]
        return Plot(
            key, title, traces, self.unit.label, y_label, x=x, linked=self.linked, shapes=self.shapes, legend=legend,
            **more,
        )  # fmt: skip


def scene_of(log: FlightLog, linked: str = LINKED) -> Scene:
    """The abscissa and the eclipses of a flight."""
    unit = time_axis(log)
    dark = dark_times(log)
    shapes = [] if dark is None else list(shaded(dark[0] / unit.scale, dark[1]))
    return Scene(log, unit, shapes, linked)


def flight_plots(scene: Scene) -> Iterator[Plot]:
    """The plots for which a flight has data, from errors to modes."""
    for draw in _PLOTS:
        plot = draw(scene)
        if plot is not None and plot.traces:
            yield plot


def _heading_error(scene: Scene) -> Plot | None:
    log = scene.log
    if log.truth is None or not log.estimates:
        return None
    traces = []
    for i, name in enumerate(log.estimates):
        of, label = look(i), estimator_label(log, name)
        traces.append(_error_line(scene, label, *heading_errors(log, name), of))
        steps, sigmas = heading_sigmas(log, name)
        if len(steps):
            traces.append(_error_line(scene, f"{name}: {_BOUND}", steps, 3.0 * sigmas, of.dashed("dot"), 1.0))
    return scene.plot("heading-error", "Estimated to true Sun", "angle [deg]", traces, y=_LOG, height=320)


def _attitude_error(scene: Scene) -> Plot | None:
    log = scene.log
    if log.truth is None or not log.attitudes:
        return None
    traces = []
    for i, name in enumerate(log.attitudes):
        steps, errors, _ = attitude_errors(log, name)
        of = look(i)
        traces.append(_error_line(scene, name, steps, errors, of))
        steps, sigmas = attitude_sigmas(log, name)
        if len(steps):
            traces.append(_error_line(scene, f"{name}: {_BOUND}", steps, 3.0 * sigmas, of.dashed("dot"), 1.0))
    return scene.plot("attitude-error", "Estimated to true attitude", "angle [deg]", traces, y=_LOG, height=320)


def _error_line(scene: Scene, name: str, steps: np.ndarray, rad: np.ndarray, of: Look, width: float = 1.5) -> Trace:
    time_s, degrees = error_series(scene.log, steps, rad)
    return line(name, time_s / scene.unit.scale, degrees, of, width=width)


def _pointing_error(scene: Scene) -> Plot | None:
    log = scene.log
    traces = []
    if log.truth is not None and not log.imported:
        traces.append(line("true", scene.time(log.truth), np.degrees(log.pointing_error), TRUE))
    if log.control is not None:
        believed = log.control.pointing_error
        degrees = np.where(believed >= 0.0, np.degrees(believed), np.nan)
        traces.append(line("as control has it", scene.time(log.control), degrees, look(0)))
        if log.truth is not None and log.flown in log.estimates:
            traces += _believed_bound(scene, log.flown, degrees)
    if not traces:
        return None
    traces += [level(30.0, "30 deg: power positive", scene.span), level(15.0, "15 deg", scene.span, "longdashdot")]
    return scene.plot("pointing-error", "Array normal to Sun", "angle [deg]", traces, y={"rangemode": "tozero"})


def _believed_bound(scene: Scene, name: str, degrees: np.ndarray) -> list[Trace]:
    """What control believes, and three sigma of the estimate that it has it from on top."""
    log = scene.log
    rows, steps = log.truth_rows(log.having("control"))
    bound_steps, sigmas = heading_sigmas(log, name)
    _, here, there = np.intersect1d(steps, bound_steps, assume_unique=True, return_indices=True)
    if not len(here):
        return []
    time = scene.time(log.having("control"))[rows[here]]
    upper = degrees[rows[here]] + 3.0 * np.degrees(sigmas[there])
    return [line(f"the same and 3 sigma that {name} claims", time, upper, look(0).dashed("dot"), width=1.0)]


def _innovations(scene: Scene) -> Plot | None:
    traces = []
    for i, (name, columns) in enumerate((scene.log.estimates | scene.log.attitudes).items()):
        known = columns.nis_dof > 0
        if known.any():
            time, ratio = scene.time(columns)[known], columns.nis[known] / columns.nis_dof[known]
            traces += _with_running_mean(scene, name, time, ratio, look(i))
    if not traces:
        return None
    traces.append(level(1.0, "1: consistent", scene.span))
    return scene.plot(
        "nis", "Normalised innovation squared (NIS)", "NIS over its degrees of freedom", traces,
        y=_LOG, caption="Thin: every step. With markers: mean over the last 60 s.",
    )  # fmt: skip


def _consistency(scene: Scene) -> Plot | None:
    log = scene.log
    if log.truth is None:
        return None
    found = [(name, *tangent_nees(log, name), 2.0) for name in log.estimates]
    for name in log.attitudes:
        steps, _, nees = attitude_errors(log, name)
        found.append((name, steps, nees, 3.0))
    traces = []
    for i, (name, steps, nees, freedom) in enumerate(found):
        known = np.isfinite(nees)
        if known.any():
            time = scene.time(log.truth)[steps[known]]
            traces += _with_running_mean(scene, name, time, nees[known] / freedom, look(i))
    if not traces:
        return None
    traces.append(level(1.0, "1: consistent", scene.span))
    return scene.plot(
        "nees", "Normalised error squared (NEES)", "NEES over its degrees of freedom", traces,
        y=_LOG, caption="Errors against the truth, by the covariance of the filter. Thin: every step. With markers: "
        "mean over the last 60 s.",
    )  # fmt: skip


def _with_running_mean(scene: Scene, name: str, time: np.ndarray, values: np.ndarray, of: Look) -> list[Trace]:
    positive = np.where(values > 0.0, values, np.nan)
    mean = running_mean(time * scene.unit.scale, values, _WINDOW_S)
    return [
        line(f"{name}: every step", time, positive, of.dashed("solid"), width=0.4),
        line(f"{name}: mean", time, np.where(mean > 0.0, mean, np.nan), of),
    ]


def running_mean(time_s: np.ndarray, values: np.ndarray, window_s: float) -> np.ndarray:
    """(N,) mean of the values (N,) in the last `window_s` before each time (N,), its own included."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    first = np.searchsorted(time_s, time_s - window_s, side="right")
    last = np.arange(1, len(values) + 1)
    return (sums[last] - sums[first]) / (last - first)


def _rate_norm(scene: Scene) -> Plot | None:
    log = scene.log
    traces = []
    if log.truth is not None and (not log.imported or np.any(log.rate > 0.0)):
        traces.append(line("true", scene.time(log.truth), np.degrees(log.rate), TRUE))
    for i, (name, columns) in enumerate((log.estimates | log.attitudes).items()):
        rates = _rates(columns)[:, 3]
        if np.isfinite(rates).any():
            traces.append(line(f"by {name}", scene.time(columns), rates, look(i)))
    if not traces:
        return None
    return scene.plot("rate", "Body rate", "rate [deg/s]", traces, y={"rangemode": "tozero"})


def _rates(columns: Columns) -> np.ndarray:
    """(M, 4) rate about each axis and its norm [deg/s], not a number where a message says that it has none."""
    rates = np.degrees(np.column_stack((columns.omega_bn_b, np.linalg.norm(columns.omega_bn_b, axis=1))))
    none = getattr(columns, "rate_source", None)
    if none is not None:
        rates[none == 0] = np.nan
    return rates


def _rate_axes(scene: Scene) -> Plot | None:
    log = scene.log
    estimates = log.estimates | log.attitudes
    name = log.flown if log.flown in estimates else next(iter(estimates), None)
    traces = []
    for i, axis in enumerate(_AXES):
        if log.truth is not None and not log.imported:
            true = np.degrees(log.truth.omega_bn_b[:, i])
            traces.append(line(f"{axis}: true", scene.time(log.truth), true, look(i)))
        if name is not None:
            rates = _rates(estimates[name])[:, i]
            if np.isfinite(rates).any():
                traces.append(line(f"{axis}: by {name}", scene.time(estimates[name]), rates, look(i).beside()))
    return scene.plot("rate-axes", "Body rate by axis", "rate [deg/s]", traces) if traces else None


def _wheel_speed(scene: Scene) -> Plot | None:
    wheels, true = scene.log.wheels, scene.log.true_wheels
    if wheels is None:
        return None
    traces = _each(scene, wheels, wheels.speed * RPM, "wheel {}")
    if true is not None:
        traces += _each(scene, true, true.speed * RPM, "wheel {}: true", beside=True)
    return scene.plot("wheel-speed", "Wheel speed", "speed [rpm]", traces)


def _wheel_torque(scene: Scene) -> Plot | None:
    traces = []
    if scene.log.torque_command is not None:
        traces += _each(scene, scene.log.torque_command, 1e3 * scene.log.torque_command.torque, "wheel {}: commanded")
    if scene.log.wheels is not None:
        traces += _each(scene, scene.log.wheels, 1e3 * scene.log.wheels.torque, "wheel {}: given", beside=True)
    return scene.plot("wheel-torque", "Wheel torque", "torque [mN m]", traces) if traces else None


def _rods(scene: Scene) -> Plot | None:
    rods = scene.log.rod_command
    if rods is None:
        return None
    return scene.plot("rods", "Torque rods", "dipole [A m^2]", _each(scene, rods, rods.dipole, "rod {}"))


def _each(scene: Scene, columns: Columns, values: np.ndarray, name: str, *, beside: bool = False) -> list[Trace]:
    time = scene.time(columns)
    looks = [look(i).beside() if beside else look(i) for i in range(values.shape[1])]
    return [line(name.format(i), time, values[:, i], of) for i, of in enumerate(looks)]


def _modes(scene: Scene) -> Plot | None:
    log = scene.log
    events = log.mission.events if log.mission is not None else ()
    traces = []
    if log.control is not None:
        modes, time = log.control.mode, scene.time(log.control)
        turns = np.flatnonzero(np.diff(modes)) + 1
        corners = np.unique(np.concatenate(([0], turns, [len(modes) - 1])))
        reasons = [
            f"{MODES.get(int(modes[i]), modes[i])}: {REASONS.get(int(log.control.reason[i]), '')}" for i in turns
        ]
        traces.append(line("mode", time[corners], modes[corners], look(0), steps=True, bins=len(modes)))
        if len(turns):
            traces.append(dots("change", time[turns].tolist(), modes[turns].tolist(), look(0), reasons, 6))
    inside = [event for event in events if event.time / scene.unit.scale <= scene.unit.last]
    if inside:
        at = [event.time / scene.unit.scale for event in inside]
        texts = [f"{event.name}: {event.node} {event.action} {event.parameter}".strip() for event in inside]
        traces.append(dots("scripted event", at, [-0.6] * len(at), Look("#D55E00", marker="triangle-up"), texts))
    if not traces:
        return None
    names = {"tickvals": list(MODES), "ticktext": list(MODES.values()), "range": [-1.0, len(MODES) - 0.5]}
    return scene.plot("mode", "Control mode and scripted events", "mode", traces, y=names)


REASONS = {
    getattr(ControlStatus, name): name.removeprefix("REASON_").lower().replace("_", " ")
    for name in dir(ControlStatus)
    if name.startswith("REASON_")
}
"""Why control is in a mode, in words."""

_PLOTS: tuple[Callable[[Scene], Plot | None], ...] = (
    _heading_error,
    _attitude_error,
    _pointing_error,
    _innovations,
    _consistency,
    _rate_norm,
    _rate_axes,
    _wheel_speed,
    _wheel_torque,
    _rods,
    _modes,
)
