# SPDX-License-Identifier: Apache-2.0
"""What the results hang on: the flights as printed with one thing changed, and what follows for the differences."""

from typing import NamedTuple

import pyarrow as pa

from css_monte_carlo.study import Configuration
from css_papers.okeefe.configurations import AS_PRINTED, AVERAGE
from css_papers.okeefe.flights import Merit, merit
from css_papers.okeefe.numbers import CONVERGING, HEADING
from css_papers.okeefe.sweeps import UNCHANGED, Change, changed
from css_papers.page import Table
from css_papers.rows import number

_NO_ALBEDO = Change("no albedo", ("css_array.albedo.enabled=false",))
_IDEAL = Change("ideal cosine, no warp", ("css_array.warp=false",))
_IDEAL_NO_ALBEDO = Change("no albedo, ideal cosine", (*_NO_ALBEDO.overrides, *_IDEAL.overrides))
_EVERY_CELL = Change("every lit cell believed", ("{estimator}.gate=0",))
_DAMPED = Change("rates damped in the deadband", ("mrp_control.deadband_behaviour=damp",))
_BOUNDED = Change("rates from Sun vectors bounded to 5 deg/s", ("{estimator}.rate.limit_deg_s=5",))
_CHANGES = (UNCHANGED, _NO_ALBEDO, _IDEAL, _IDEAL_NO_ALBEDO, _EVERY_CELL, _DAMPED, _BOUNDED)


class _Column(NamedTuple):
    title: str
    field: str


_COLUMNS = (
    _Column("heading error at the end [deg]", "heading_error_late_deg"),
    _Column("pointing error [deg]", "pointing_error_deg"),
    _Column("rate at 50 min [deg/s]", "rate_50min_deg_s"),
    _Column("mean converging [min]", "converging_mean_min"),
    _Column("longest converging [min]", "converging_max_min"),
)


def control_configurations() -> list[Configuration]:
    """What flies for the controls."""
    return [changed(entry.configuration, change) for change in _CHANGES for entry in AS_PRINTED]


def control_table(cases: pa.Table) -> Table:
    """What each change does; `cases` of a study of `control_configurations`."""
    lines = []
    for label, results in _results(cases).items():
        for change, m in results.items():
            values = m._asdict()
            lines.append([f"{label}: {change.label}", *(number(values[column.field]) for column in _COLUMNS)])
    return Table(["", *(column.title for column in _COLUMNS)], lines)


def difference_notes(cases: pa.Table) -> dict[tuple[str, str], str]:
    """Label and kind of quantity to what the controls say about the difference to the paper."""
    notes = {}
    entries = {entry.label: entry.configuration for entry in AS_PRINTED}
    for label, results in _results(cases).items():
        error = {change: number(m.heading_error_late_deg) for change, m in results.items()}
        longest = {change: number(m.converging_max_min) for change, m in results.items()}
        parts = (
            f"without albedo {error[_NO_ALBEDO]}, without warp {error[_IDEAL]}, without both {error[_IDEAL_NO_ALBEDO]}"
        )
        if label.startswith(AVERAGE):
            off = number(results[UNCHANGED].pointing_error_deg)
            notes[label, HEADING] = (
                f"it grows with the angle of the Sun to the array normal (Figure 2), here {off} deg in the mean, in "
                f"the paper about 10; {parts}"
            )
        else:
            notes[label, HEADING] = (
                f"which cells are believed decides, of which the paper says little: if it is every lit one "
                f"{error[_EVERY_CELL]}; {parts}"
            )
        if not entries[label].gyro:
            notes[label, CONVERGING] = (
                f"of the controls' cases {longest[UNCHANGED]}, if every lit cell is believed {longest[_EVERY_CELL]}, "
                f"with rates from Sun vectors bounded to 5 instead of 10 deg/s {longest[_BOUNDED]}, damped in the "
                f"deadband {longest[_DAMPED]}"
            )
    return notes


def _results(cases: pa.Table) -> dict[str, dict[Change, Merit]]:
    return {
        entry.label: {change: merit(cases, changed(entry.configuration, change)) for change in _CHANGES}
        for entry in AS_PRINTED
    }
