# SPDX-License-Identifier: Apache-2.0
"""The part of the page that is flown: Figures 6 to 8 of O'Keefe & Schaub 2013 and their numbers."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from css_analysis.flight_log import SUNLIT_FRACTION
from css_analysis.flight_metrics import windows_of
from css_common.mission import Mission
from css_environment.mission_environment import MissionEnvironment
from css_papers.okeefe.flight_figures import (
    HEADING_ERROR,
    POINTING_ERROR,
    RATE,
    RATE_KNOWLEDGE,
    Shadow,
    Variant,
    write_against_time,
    write_converging,
)
from css_papers.okeefe.flights import Merit, merit
from css_papers.okeefe.numbers import (
    CONVERGING_LIMITS_MIN,
    attitude_rows,
    flight_rows,
    orbit_rows,
)
from css_papers.page import Part, Picture, Section, Table


def shadow_of(mission: Mission, step_s: float = 1.0) -> Shadow:
    """Where the flight of a mission is dark."""
    environment = MissionEnvironment(mission.values, field=False)
    time_s = np.arange(0.0, mission.values.mission.duration, step_s)
    illumination = np.array([environment.at(float(time)).illumination for time in time_s])
    return Shadow(time_s, illumination <= SUNLIT_FRACTION)


def flight_part(
    mission: Mission, printed: Variant, improved: Variant, notes: Mapping[tuple[str, str], str], folder: Path
) -> Part:
    """Figs. 6 to 8."""
    shadow, windows = shadow_of(mission), windows_of(mission)
    variants = (printed, improved)
    plots = [
        Picture(write_against_time(quantity, variants, shadow, folder / f"{name}.png").name, caption)
        for quantity, name, caption in (
            (HEADING_ERROR, "figure_6", "Figure 6. Angle of estimated to true Sun."),
            (
                POINTING_ERROR,
                "pointing_error",
                "Angle of array normal to true Sun, with 30 deg (power positive) and 15 deg (the paper's deadband).",
            ),
            (RATE, "figure_7a", "Figure 7a. Body rate."),
            (RATE_KNOWLEDGE, "figure_7b", "Figure 7b. Error of the estimated body rate."),
        )
    ]
    converging = write_converging(variants, CONVERGING_LIMITS_MIN, folder / "figure_8.png")
    plots.append(
        Picture(
            converging.name,
            "Figure 8. Time spent converging: sunlit time with the array normal more than 30 deg off the Sun, in all, "
            "in the first pass through sunlight, and after eclipse. A line is the share of cases that spent longer.",
        )
    )
    rows = [
        *orbit_rows(mission.values.mission.duration, shadow),
        *flight_rows(printed, shadow, windows, notes),
        *flight_rows(improved, shadow, windows),
        *attitude_rows(printed, shadow, windows),
    ]
    return Part([Section("Flights", plots), Section("Converging", [converging_table(variants)])], rows)


def converging_table(variants: Sequence[Variant]) -> Table:
    """First acquisition and re-acquisition after eclipse apart."""
    heading = ["longest time converging [min]", "all", "first pass", "after eclipse", "mean, all", "cases"]
    lines = []
    for variant in variants:
        for label, m in _merits(variant).items():
            longest = (m.converging_max_min, m.converging_first_max_min, m.converging_later_max_min)
            times = [_minutes(time) for time in (*longest, m.converging_mean_min)]
            lines.append([f"{variant.name}: {label}", *times, f"{m.cases}"])
    return Table(heading, lines)


def _minutes(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _merits(variant: Variant) -> dict[str, Merit]:
    return {entry.label: merit(variant.cases, entry.configuration) for entry in variant.entries}


def settings(mission: Mission, improved: Variant) -> list[str]:
    """What flies where, one line each."""
    control = mission.node("mrp_control").values
    lines = [
        f"as the paper: the mission as it is, K {control.gains.k:g} N m, P {control.gains.p:g} N m s, "
        f"K_I {control.gains.ki:g}, deadband {control.deadband_deg:g} deg ({control.deadband_behaviour} torque)",
    ]
    for entry in improved.entries:
        c = entry.configuration
        lines.append(f"{improved.name}, {entry.label}: {c.estimator}, {', '.join(c.overrides)}")
    return lines
