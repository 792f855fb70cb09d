# SPDX-License-Identifier: Apache-2.0
"""Two flights or studies beside each other."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from css_analysis.estimator_runs import Run
from css_analysis.flight_log import FlightLog
from css_analysis.flight_metrics import windows_of
from css_analysis.quantities import flight_quantities
from css_report.blocks import Beside, Block, Plot, Section, Table
from css_report.tables import NONE, run_label, value_text


def beside(names: tuple[str, str], first: Sequence[Section], second: Sequence[Section]) -> list[Section]:
    """The sections of both, those of one title side by side, plots of one key next to each other."""
    titles = dict.fromkeys(section.title for section in (*first, *second))
    ours = {section.title: section.blocks for section in first}
    theirs = {section.title: section.blocks for section in second}
    return [Section(title, list(_paired(names, ours.get(title, ()), theirs.get(title, ())))) for title in titles]


def _paired(names: tuple[str, str], ours: Sequence[Block], theirs: Sequence[Block]) -> Iterator[Block]:
    """Plots by their keys, in pairs; what is no plot before them, as a pair of columns."""
    texts = tuple([block for block in side if not isinstance(block, Plot)] for side in (ours, theirs))
    plots = tuple({block.key: block for block in side if isinstance(block, Plot)} for side in (ours, theirs))
    for key in dict.fromkeys((*plots[0], *plots[1])):
        pair = tuple(
            [side[key]] if key in side else [f"no plot of this kind: {plots[1 - i][key].title}"]
            for i, side in enumerate(plots)
        )
        yield Beside(names, _alike(pair))
    if texts[0] or texts[1]:
        yield Beside(names, (texts[0] or ["nothing"], texts[1] or ["nothing"]))


def _alike(pair) -> tuple[Sequence[Block], Sequence[Block]]:
    """Two plots of the same height and the same stretch of time."""
    plots = [block for side in pair for block in side if isinstance(block, Plot)]
    if len(plots) < 2:
        return pair
    height = max(plot.height for plot in plots)
    ranges = [plot.x["range"] for plot in plots if "range" in plot.x]
    x = {"range": [min(r[0] for r in ranges), max(r[1] for r in ranges)]} if len(ranges) == 2 else {}
    return tuple([replace(plot, height=height, x={**plot.x, **x})] for plot in plots)  # type: ignore[return-value]


def merits_beside(
    names: tuple[str, str], runs: tuple[Sequence[Run], Sequence[Run]], log: FlightLog, other: FlightLog
) -> Table:
    """A line for each quantity and estimator that both have, with the difference; others with a dash."""
    known = flight_quantities(windows_of(log.mission)) | flight_quantities(windows_of(other.mission))
    sides = [{run_label(run): run for run in side} for side in runs]
    lines = []
    for label in dict.fromkeys((*sides[0], *sides[1])):
        for quantity in known.values():
            values = [side[label].get(quantity.name) if label in side else None for side in sides]
            if values == [None, None]:
                continue
            first, second = values
            difference = NONE if first is None or second is None else value_text(quantity, second - first)
            lines.append(
                [f"{label}: {quantity.name}", quantity.unit, *(value_text(quantity, v) for v in values), difference]
            )
    return Table(["quantity", "unit", *names, "second less first"], lines)
