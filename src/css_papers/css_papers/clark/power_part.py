# SPDX-License-Identifier: Apache-2.0
"""The part of the page on power: what the angles of the flights mean for panels with reflectors."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from css_papers.clark.figures import write_power
from css_papers.clark.flights import Flight
from css_papers.clark.panel_power import power_curve
from css_papers.page import Picture, Section, Table

_GRID = np.linspace(0.0, np.pi, 361)


def mean_power(flight: Flight) -> float:
    """Mean power over sunlight, relative to panels that face the Sun, which moves in the worst plane."""
    angles = np.radians(flight.panel_true[flight.sunlit])
    return float(np.interp(angles, _GRID, power_curve(_GRID)).mean())


def power_section(flights: Mapping[str, Flight], folder: Path) -> Section:
    """Curve, and the mean power of each flight."""
    lines = [
        [
            name,
            f"{flight.mean_panel:.2f}",
            f"{mean_power(flight):.3f}",
            f"{np.maximum(np.cos(np.radians(flight.panel_true[flight.sunlit])), 0.0).mean():.3f}",
        ]
        for name, flight in flights.items()
    ]
    text = (
        "The paper says in words that reflectors make power drop more quickly with the angle. The model here is a "
        "choice: two mirrors along the panel's edges, as long as the panel is wide, 30 deg out of the normal, 85 % "
        "reflectance, the Sun in the plane across them, rays traced."
    )
    picture = Picture(write_power(folder / "power.png").name, "Power over the angle of panel to Sun.")
    heading = ["flight", "panel to Sun [deg]", "mean power with reflectors", "without"]
    return Section("Power", [text, picture, Table(heading, lines)])
