# SPDX-License-Identifier: Apache-2.0
"""What the averages hang on: gains and inertia, which the paper does not give, and the light of the Earth."""

from typing import NamedTuple

import numpy as np
import pyarrow as pa

from css_common.mission import Mission, load_mission
from css_papers.clark.cases import Averages, averages, configuration, fly_cases_of
from css_papers.clark.flights import DOUBLED, FLAT, PYRAMID
from css_papers.clark.numbers import PANEL_PYRAMID
from css_papers.page import Table
from css_papers.papers import Request

_NONE = "no albedo"
_TWICE = "albedo doubled"
AS_FLOWN = "as flown"
GAINS = ((0.148, 0.9), (0.02, 0.35), (0.01, 0.25), (0.003, 0.14), (0.002, 0.115))
"""K [N m] and P [N m s]; the first are those of O'Keefe & Schaub 2013."""


class Controls(NamedTuple):
    """Averages of both missions by what was changed."""

    flat: dict[str, Averages]
    pyramid: dict[str, Averages]


def _gain_name(k: float, p: float) -> str:
    return f"K {k:g}, P {p:g}"


def _inertia(mission: Mission, factor: float) -> tuple[str, ...]:
    scaled = factor * mission.values.spacecraft.inertia
    return ("spacecraft.inertia=" + ",".join(f"{moment:g}" for moment in scaled.ravel()),)


def changes() -> dict[str, tuple[str, ...]]:
    """Name of a change to its overrides."""
    mission = load_mission(FLAT)
    found: dict[str, tuple[str, ...]] = {AS_FLOWN: ()}
    for k, p in GAINS:
        found[_gain_name(k, p)] = (f"mrp_control.gains.k={k:g}", f"mrp_control.gains.p={p:g}")
    for factor in (0.5, 2.0, 4.0):
        found[f"inertia x {factor:g}"] = _inertia(mission, factor)
    found[_NONE] = ("css_array.albedo.enabled=false",)
    found["albedo by patches"] = ("css_array.albedo.model=patches",)
    found[_TWICE] = DOUBLED
    found["albedo from nadir, 0.3"] = (
        "css_array.albedo.reflectivity=constant",
        "css_array.albedo.constant=0.3",
        "css_array.albedo.model=nadir",
    )
    return found


def fly_controls(cases: int, request: Request) -> Controls:
    """Flies both missions with every change."""
    found = changes()

    def of(mission: str) -> dict[str, Averages]:
        table: pa.Table = fly_cases_of(mission, list(found.values()), cases, "controls", request).cases
        return {name: averages(table, configuration(mission, change)) for name, change in found.items()}

    return Controls(of(FLAT), of(PYRAMID))


def control_table(controls: Controls) -> Table:
    """Averages by change."""
    heading = ["", "error, flat [deg]", "panel, flat [deg]", "beyond 30 deg, flat [min]",
               "panel, pyramid [deg]", "beyond 30 deg, pyramid [min]", "pyramid over flat"]  # fmt: skip
    lines = []
    for name, flat in controls.flat.items():
        pyramid = controls.pyramid[name]
        lines.append(
            [
                name,
                f"{flat.error:.2f}",
                f"{flat.panel:.2f}",
                f"{flat.converging_min:.1f}",
                f"{pyramid.panel:.2f}",
                f"{pyramid.converging_min:.1f}",
                f"{pyramid.panel / flat.panel:.2f}",
            ]
        )
    return Table(heading, lines)


def flat_note(controls: Controls) -> str:
    """Why the flat cells keep the panels closer to the Sun than in the paper, in numbers."""
    flat, pyramid = controls.flat, controls.pyramid
    here = f"{flat[AS_FLOWN].panel:.1f} deg in the controls: {pyramid[_NONE].panel:.1f} of it are acquisition, "
    parts = (
        f"{flat[_NONE].panel - pyramid[_NONE].panel:.1f} the drop-out and noise of flat cells, "
        f"{flat[AS_FLOWN].panel - flat[_NONE].panel:.1f} albedo. "
    )
    softest, at_paper = GAINS[-1], _flat_at(controls, PANEL_PYRAMID)
    slower = (
        f"Acquisition goes with gains and inertia, which the paper does not give: the softest gains here, K "
        f"{softest[0]:g} N m, have {flat[_gain_name(*softest)].panel:.1f} (pyramid "
        f"{pyramid[_gain_name(*softest)].panel:.1f}), and gains with the paper's {PANEL_PYRAMID} for the pyramid would "
        f"have {at_paper:.1f}. "
    )
    return f"{here}{parts}{slower}The table of albedo is not public: doubled it is {flat[_TWICE].panel:.1f}"


def _flat_at(controls: Controls, pyramid_deg: float) -> float:
    """Angle of the flat cells for gains with which the pyramid has a given one, between those that flew."""
    names = [AS_FLOWN, *(_gain_name(*gains) for gains in GAINS)]
    known = np.array(sorted((controls.pyramid[name].panel, controls.flat[name].panel) for name in names))
    return float(np.interp(pyramid_deg, known[:, 0], known[:, 1]))
