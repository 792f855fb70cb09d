# SPDX-License-Identifier: Apache-2.0
"""Figures 1, 3, 5, 7 and 8 of Benton."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from css_analysis.figure_style import (
    BLUE,
    GREY,
    VERMILION,
    colours,
    draw_series,
    legend,
    level_line,
    logarithmic,
    new_figure,
    save,
    shade_dark,
    style,
)
from css_papers.clark.cell import Response
from css_papers.clark.flights import FLAT, PYRAMID, Flight
from css_papers.clark.panel_power import power_curve
from css_papers.clark.seasons import Campaign, Profile, panel_angles

_WIDTH = 8.6
_MINUTE = 60.0


def write_error(flight: Flight, file: Path) -> Path:
    """Figure 1: sensed to true Sun, zero in the shadow, with the mean over sunlight."""
    with style():
        figure = new_figure(_WIDTH, 3.0)
        axes = figure.subplots()
        minutes = flight.time_s / _MINUTE
        shade_dark(axes, minutes, ~flight.sunlit)
        draw_series(axes, minutes, np.where(flight.sunlit, flight.error, 0.0), BLUE)
        level_line(axes, flight.mean_error, f"{flight.mean_error:.2f}°")
        axes.set_xlabel("time [min]")
        axes.set_ylabel("sensed to true Sun [deg]")
        axes.set_ylim(bottom=0.0)
        axes.set_title("Error of the sensed Sun")
        return save(figure, file)


def write_panel(flight: Flight, title: str, file: Path) -> Path:
    """Figures 5, 7 and 8: panel normal to the true and to the sensed Sun, with the mean of the first over sunlight."""
    with style():
        figure = new_figure(_WIDTH, 3.4)
        axes = figure.subplots()
        minutes = flight.time_s / _MINUTE
        shade_dark(axes, minutes, ~flight.sunlit)
        draw_series(axes, minutes, flight.panel_sensed, VERMILION, "sensed Sun", width=0.7)
        draw_series(axes, minutes, flight.panel_true, BLUE, "true Sun")
        level_line(axes, flight.mean_panel, f"{flight.mean_panel:.2f}°")
        axes.set_xlabel("time [min]")
        axes.set_ylabel("panel normal to Sun [deg]")
        axes.set_ylim(bottom=0.0)
        axes.set_title(title)
        legend(axes, title="shaded: eclipse")
        return save(figure, file)


def write_response(response: Response, uncertainty_deg: Mapping[float, float], file: Path) -> Path:
    """Figure 3: output of a cell over the angle from its normal, and the angle that one count covers."""
    with style():
        figure = new_figure(_WIDTH, 3.0)
        axes, counts = figure.subplots(1, 2)
        axes.plot(response.angle_deg, response.output, color=BLUE)
        axes.set_xlabel("angle from the normal [deg]")
        axes.set_ylabel("output [-]")
        axes.set_title("Output of a cell")
        counts.plot(list(uncertainty_deg), list(uncertainty_deg.values()), "o-", color=BLUE, markersize=3.0)
        counts.set_xlabel("angle from the normal [deg]")
        counts.set_ylabel("angle within one count [deg]")
        counts.set_title("What 12 bits cannot tell")
        logarithmic(counts)
        return save(figure, file)


def write_profiles(profiles: Mapping[str, Profile], file: Path) -> Path:
    """Mean error of the flat cells over the time in a pass, a line for each date."""
    with style():
        figure = new_figure(_WIDTH, 3.2)
        axes = figure.subplots()
        for (date, profile), colour in zip(profiles.items(), colours(len(profiles)), strict=True):
            axes.plot(profile.minutes, profile.error, color=colour, label=date)
        axes.set_xlabel("time since sunrise [min]")
        axes.set_ylabel("sensed to true Sun [deg]")
        axes.set_ylim(bottom=0.0)
        axes.set_title("Flat cells, mean over passes and cases")
        legend(axes)
        return save(figure, file)


def write_campaign(campaign: Campaign, file: Path) -> Path:
    """Share of the cases whose mean angle of panel to Sun is below an angle, by cells and albedo."""
    scales = sorted({point.scale for point in campaign.points})
    with style():
        figure = new_figure(_WIDTH, 3.2)
        axes = figure.subplots()
        for mission, name, colour in ((FLAT, "flat", VERMILION), (PYRAMID, "pyramid", BLUE)):
            for scale, dashes in zip(scales, ((1, 1), (), (5, 2)) if len(scales) == 3 else ((), (5, 2)), strict=True):
                angles = np.sort(panel_angles(campaign, mission, scale))
                share = 100.0 * (np.arange(len(angles)) + 1.0) / len(angles)
                line = axes.step(angles, share, where="post", color=colour, label=f"{name}, albedo x {scale:g}")[0]
                if dashes:
                    line.set_dashes(dashes)
        axes.axvline(10.0, color=GREY, linewidth=0.8)
        axes.set_xlim(left=0.0)
        axes.set_xlabel("mean angle of panel to Sun [deg]")
        axes.set_ylabel("share of cases below [%]")
        axes.set_title("All cases")
        legend(axes)
        return save(figure, file)


def write_power(file: Path) -> Path:
    """Power of the panels with and without reflectors over the angle to the Sun."""
    degrees = np.linspace(0.0, 90.0, 181)
    with style():
        figure = new_figure(_WIDTH, 3.0)
        axes = figure.subplots()
        axes.plot(degrees, power_curve(np.radians(degrees)), color=BLUE, label="with reflectors")
        axes.plot(degrees, np.cos(np.radians(degrees)), color=GREY, label="without")
        axes.set_xlabel("panel normal to Sun [deg]")
        axes.set_ylabel("power, facing the Sun 1")
        axes.set_title("Power of the panels")
        legend(axes)
        return save(figure, file)
