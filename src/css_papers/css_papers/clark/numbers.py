# SPDX-License-Identifier: Apache-2.0
"""Numbers of Benton beside ours."""

from collections.abc import Mapping, Sequence

import numpy as np

from css_papers.clark.flights import Flight, acquisition_min, handover_min
from css_papers.rows import Must, Row, row

ERROR_FLAT, PANEL_FLAT, PANEL_PYRAMID, PANEL_DOUBLED, ACQUISITION_MIN = 5.03, 16.3, 8.54, 8.55, 6.0
"""Of the paper: angles [deg] over sunlight, and minutes from sunrise."""

FLAT_ANGLE = "panel to Sun, flat"
"""Quantity that a note may explain."""
GOAL = Must(None, 10.0)
INSENSITIVE = Must(None, 0.5)
HALVED = Must(None, 0.6)
_ACQUISITION = Must(4.0, 8.0)


def angle_rows(
    error_flat: float,
    flat: float,
    pyramid: float,
    doubled: float,
    variant: str = "",
    notes: Mapping[str, str] | None = None,
) -> list[Row]:
    """The paper's table for one set of averages [deg] over sunlight."""

    def line(quantity: str, unit: str, paper: float, here: float, must: Must | None = None) -> Row:
        return row(quantity, unit, paper, here, must, variant=variant, note=(notes or {}).get(quantity, ""))

    return [
        line("error of the sensed Sun, flat", "deg", ERROR_FLAT, error_flat),
        line(FLAT_ANGLE, "deg", PANEL_FLAT, flat),
        line("panel to Sun, pyramid", "deg", PANEL_PYRAMID, pyramid, GOAL),
        line("panel to Sun, pyramid, doubled", "deg", PANEL_DOUBLED, doubled, GOAL),
        line("pyramid, doubled to nominal", "deg", PANEL_DOUBLED - PANEL_PYRAMID, abs(doubled - pyramid), INSENSITIVE),
        line("pyramid over flat", "-", PANEL_PYRAMID / PANEL_FLAT, pyramid / flat, HALVED),
    ]


def acquisition_rows(flights: Sequence[Flight]) -> list[Row]:
    """How long acquisition after a sunrise takes; means over all passes, infinite if one never acquires."""
    steady = [time for flight in flights for time in acquisition_min(flight)]
    handover = [time for flight in flights for time in handover_min(flight)]
    note = f"{len(steady)} sunrises, to stay until the end of the pass; gains were chosen for it"
    return [
        row("acquisition, to 10 deg", "min", ACQUISITION_MIN, _mean(steady), _ACQUISITION,
            relation="about", note=note),
        row("acquisition, to the pyramid", "min", ACQUISITION_MIN, _mean(handover), relation="about"),
    ]  # fmt: skip


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
