# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo flights of both ways to sense the Sun, and their averages."""

from typing import NamedTuple

import numpy as np
import pyarrow as pa

from css_common.mission import load_mission
from css_monte_carlo.study import Configuration, Study, run_study
from css_papers.clark.flights import FLAT, PYRAMID
from css_papers.papers import Request
from css_papers.study_columns import column

ESTIMATORS = {FLAT: "flat", PYRAMID: "pyramid_switch"}


class Averages(NamedTuple):
    """Means over the cases of one configuration, over sunlight with acquisition; angles in deg."""

    cases: int
    error: float  # sensed to true Sun
    panel: float  # panel to true Sun
    panel_p95: float  # 95th percentile over the cases of their means
    panel_max: float
    converging_min: float  # sunlit, beyond 30 deg


def configuration(mission: str, overrides: tuple[str, ...] = ()) -> Configuration:
    """How a mission flies with something changed."""
    return Configuration(ESTIMATORS[mission], False, overrides)


def fly_cases_of(
    mission: str, changes: list[tuple[str, ...]], cases: int, name: str, request: Request, base: tuple[str, ...] = ()
) -> Study:
    """Flies so many cases of a mission with each set of overrides, all of them on top of `base`."""
    # the number of cases is part of the name, so that a quick look leaves a long study alone
    folder = request.folder / "studies" / f"{name}_{ESTIMATORS[mission]}_{cases}"
    progress = None if request.progress is None else request.progress(f"{name}, {ESTIMATORS[mission]}")
    configurations = list(dict.fromkeys(configuration(mission, change) for change in changes))
    return run_study(load_mission(mission, list(base)), configurations, cases, folder, sample_s=10.0, progress=progress)


def averages(cases: pa.Table, flown: Configuration) -> Averages:
    """Averages of one configuration out of a study's `cases`."""
    panel = column(cases, flown, "pointing_error_sunlit_deg")
    return Averages(
        cases=len(panel),
        error=float(np.mean(column(cases, flown, "heading_error_sunlit_deg"))),
        panel=float(np.mean(panel)),
        panel_p95=float(np.percentile(panel, 95.0)),
        panel_max=float(np.max(panel)),
        converging_min=float(np.mean(_converging(cases, flown))) / 60.0,
    )


def _converging(cases: pa.Table, flown: Configuration) -> np.ndarray:
    return column(cases, flown, "converging_first_s") + column(cases, flown, "converging_later_s")
