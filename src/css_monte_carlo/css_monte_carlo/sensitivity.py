# SPDX-License-Identifier: Apache-2.0
"""Which of the dispersed parameters matter: Sobol indices of a study that was drawn by a Saltelli design.

The first index of a parameter is the share of the variance that it causes alone, the total index the share that would
be gone if it were known. What is drawn for a case without being a dispersion (initial state, noise, clouds) counts as
one more parameter, so that indices are shares of all the variance that there is.
"""

import warnings
from typing import Any, NamedTuple

import numpy as np

from css_analysis.errors import StudyError
from css_analysis.intervals import LEVEL
from css_analysis.study_summary import rows_of, summaries_of
from css_common.mission import Mission, mission_from_text
from css_common.sampling import groups_of, saltelli_problem
from css_monte_carlo.study import Study

_LEAST_POINTS = 8


class Index(NamedTuple):
    """Of one parameter, with half the widths of 95 % intervals."""

    parameter: str
    first: float
    first_half: float
    total: float
    total_half: float


class Sensitivity(NamedTuple):
    """Of one quantity in one configuration.

    Attributes:
        labels: estimator, gyro, overrides.
        quantity: column of the table of cases.
        indices: largest total first; none where too few points have values, or all the same one.
        points, left_out: base points of the design, and how many of them have a flight without a value.
    """

    labels: dict[str, Any]
    quantity: str
    indices: tuple[Index, ...]
    points: int
    left_out: int

    def as_object(self) -> dict[str, Any]:
        """What `--json` says."""
        return {
            **self.labels,
            "quantity": self.quantity,
            "base_points": self.points,
            "base_points_left_out": self.left_out,
            "indices": [
                {
                    "parameter": i.parameter,
                    "first": i.first,
                    "first_interval_95": [i.first - i.first_half, i.first + i.first_half],
                    "total": i.total,
                    "total_interval_95": [i.total - i.total_half, i.total + i.total_half],
                }
                for i in self.indices
            ],
        }


def sensitivities(study: Study, quantity: str = "") -> list[Sensitivity]:
    """Indices of every configuration.

    Args:
        quantity: column of the table of cases; empty: the first that is told of the estimator.

    Raises:
        StudyError: the study has no such quantity, or is of another design.
    """
    mission = mission_from_text(study.manifest["mission_text"], str(study.folder))
    if mission.values.sampling.method != "saltelli":
        raise StudyError(
            f"{study.folder}: drawn by {mission.values.sampling.method}, expected a study of --sensitivity"
        )
    found = []
    for labels in study.manifest["configurations"]:
        name = quantity or summaries_of(study, labels["estimator"])[0].of
        known = study.cases.column_names
        if name not in known:
            raise StudyError(f"--sensitivity: {name} given, expected one of {', '.join(known)}")
        column = rows_of(study.cases, **labels)[name].cast("double").to_numpy(zero_copy_only=False)
        found.append(_indices(mission, dict(labels), name, column))
    return found


def _indices(mission: Mission, labels: dict[str, Any], name: str, values: np.ndarray) -> Sensitivity:
    groups = groups_of(mission.dispersions)
    names = list(dict.fromkeys(groups))
    # rows of a base point stand together: its first, one for each group, its second
    blocks = values.reshape(-1, len(names) + 2)
    whole = np.all(np.isfinite(blocks), axis=1)
    kept = blocks[whole]
    left_out = int(np.count_nonzero(~whole))
    if len(kept) < _LEAST_POINTS or np.ptp(kept) == 0.0:
        return Sensitivity(labels, name, (), len(blocks), left_out)
    from SALib.analyze import sobol

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of a table that SALib makes for its own use
        found = sobol.analyze(
            saltelli_problem(groups), kept.ravel(), calc_second_order=False, conf_level=LEVEL, num_resamples=500, seed=0
        )
    rows = zip(names, found["S1"], found["S1_conf"], found["ST"], found["ST_conf"], strict=True)
    indices = sorted((Index(row[0], *map(float, row[1:])) for row in rows), key=lambda index: -index.total)
    return Sensitivity(labels, name, tuple(indices), len(blocks), left_out)
