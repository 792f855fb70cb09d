# SPDX-License-Identifier: Apache-2.0
"""Attitude about all three axes by the Sun and the light of the Earth, without a magnetometer."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from css_common.mission import load_mission
from css_monte_carlo.study import Configuration, run_study
from css_papers.page import Listing, Section, Table
from css_papers.papers import Request
from css_papers.rows import Must, Row, number, row
from css_papers.study_columns import column, mean_of

MISSION = "okeefe_earthlight"
_ESTIMATOR = "earthlight"
_ERROR, _CONSISTENT = Must(None, 3.0), Must(2.4, 3.6)
_COLUMNS = (
    ("attitude error [deg]", "attitude_error_mean_deg"),
    ("95 % [deg]", "attitude_error_p95_deg"),
    ("NEES (3)", "attitude_nees"),
    ("NIS / dof (1)", "attitude_nis"),
    ("first attitude [s]", "first_attitude_s"),
)
_NOTES = (
    "mean over all samples with an attitude from 900 s on, in the shadow too; most of the error is the turn about "
    "the Sun line",
    "first attitude: mean over the cases of the instant when one turn is left; before it no attitude is given",
)


def three_axes(request: Request) -> tuple[list[Row], Section]:
    """Flies the mission with gyro and without; its rows and its section of the page."""
    configurations = {gyro: Configuration(_ESTIMATOR, gyro, ()) for gyro in (True, False)}
    progress = None if request.progress is None else request.progress("three axes by the light of the Earth")
    folder = request.folder / "studies" / f"three_axes_{request.cases}"
    study = run_study(load_mission(MISSION), list(configurations.values()), request.cases, folder, progress=progress)
    rows, lines = [], []
    for gyro, configuration in configurations.items():
        variant = "gyro" if gyro else "no gyro"
        rows += list(_rows(study.cases, configuration, variant))
        values = (mean_of(column(study.cases, configuration, name)) for _, name in _COLUMNS)
        lines.append([variant, *(number(value) for value in values)])
    table = Table(["", *(title for title, _ in _COLUMNS)], lines)
    return rows, Section("Three axes by the light of the Earth", [table, Listing(_NOTES)])


def _rows(cases: pa.Table, configuration: Configuration, variant: str) -> Iterator[Row]:
    def mean(name: str) -> float | None:
        return mean_of(column(cases, configuration, name))

    yield row("three axes: attitude error", "deg", None, mean("attitude_error_mean_deg"), _ERROR, variant=variant)
    yield row("three axes: NEES of 3", "-", None, mean("attitude_nees"), _CONSISTENT, variant=variant)
    found = float(np.mean(np.isfinite(column(cases, configuration, "first_attitude_s"))))
    yield row("three axes: attitude found", "-", None, found, Must(1.0), variant=variant)
