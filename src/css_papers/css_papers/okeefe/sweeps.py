# SPDX-License-Identifier: Apache-2.0
"""Flights with something changed: the sweeps of what O'Keefe & Schaub 2013 left as future work."""

from typing import NamedTuple

from css_monte_carlo.study import Configuration
from css_papers.okeefe.configurations import SWEPT


class Change(NamedTuple):
    """Something that is made different."""

    label: str
    overrides: tuple[str, ...]  # `{estimator}` stands for the one that flies


UNCHANGED = Change("as flown", ())


class Sweep(NamedTuple):
    """One error of the cells in several sizes."""

    name: str  # of its files
    title: str
    axis: str
    explanation: str
    points: tuple[tuple[float, str, Change], ...]  # abscissa, its label, what is changed


def _scale(scale: float) -> tuple[float, str, Change]:
    percent = 100.0 * (scale - 1.0)
    label = f"{percent:+.0f} %" if percent else "0 %"
    return percent, label, Change(f"all cells {label}", (f"css_array.scale={scale:g}",) if percent else ())


def _spread(sigma: float) -> tuple[float, str, Change]:
    label = f"{100.0 * sigma:.0f} %"
    overrides = (f"css_array.scale_cell_error={sigma:g}",) if sigma else ()
    return 100.0 * sigma, label, Change(f"each cell {label}", overrides)


def _failures(place: int, count: int, kind: str) -> tuple[float, str, Change]:
    if not count:
        return place, "none", UNCHANGED
    failed = (f"css_array.random_faults.count={count}", f"css_array.random_faults.kind={kind}")
    return place, f"{count} {kind}", Change(f"{count} {kind}", failed)


SWEEPS = (
    Sweep(
        "common_scale",
        "Scale error of all cells",
        "output of all cells beyond calibration",
        "All cells read too much or too little by the same share, the same in every case.",
        tuple(map(_scale, (0.8, 0.9, 1.0, 1.1, 1.2))),
    ),
    Sweep(
        "cell_scale",
        "Scale error of each cell",
        "scale error of each cell, 1 sigma",
        "Each cell has its own normal error of scale, drawn for each case.",
        tuple(map(_spread, (0.0, 0.05, 0.1, 0.15, 0.2))),
    ),
    Sweep(
        "failures",
        "Failed cells",
        "failed cells, drawn for each case",
        "Cells fail before the flight begins, which ones is drawn for each case. Dead cells read nothing, stuck ones "
        "hold an output drawn between dark and full Sun. No estimator looks for failures.",
        tuple(
            _failures(place, *failed)
            for place, failed in enumerate(((0, ""), (1, "dead"), (2, "dead"), (1, "stuck"), (2, "stuck")))
        ),
    ),
)
"""Calibration errors and failures of cells."""


def changed(configuration: Configuration, change: Change) -> Configuration:
    """A configuration with a change."""
    overrides = tuple(text.format(estimator=configuration.estimator) for text in change.overrides)
    return configuration._replace(overrides=configuration.overrides + overrides)


def sweep_configurations() -> list[Configuration]:
    """What flies for the sweeps; what several have in common flies once."""
    changes = [change for sweep in SWEEPS for _, _, change in sweep.points]
    return list(dict.fromkeys(changed(entry.configuration, change) for change in changes for entry in SWEPT))
