# SPDX-License-Identifier: Apache-2.0
"""Which units failed and which were held for failed, against time: a line of bars for each unit."""

from matplotlib.axes import Axes

from css_analysis.figure_style import BLACK, colours
from css_analysis.flight_log import FlightLog
from css_analysis.unit_spells import rank, spells

_FAULT_HEIGHT, _HELD_HEIGHT = 0.8, 0.3


def draw_health(axes: Axes, log: FlightLog, scale: float, last: float) -> None:
    """Wide bars where a unit fails, narrow ones where it is held for failed.

    Args:
        scale: [s] of one unit of the abscissa.
        last: end of the flight, in that unit.
    """
    found = spells(log)
    targets = sorted({spell.target for spell in found}, key=rank)
    judges = sorted({spell.by for spell in found if spell.by})
    shades = dict(zip(judges, colours(len(judges)), strict=True))
    step = _HELD_HEIGHT / max(len(judges), 1)
    labelled: set[str] = set()
    for spell in found:
        at = len(targets) - 1 - targets.index(spell.target)
        begin = spell.begin_s / scale
        end = last if spell.end_s is None else spell.end_s / scale
        bar = [(begin, end - begin)]
        label = spell.by or "fails"
        shown = "_" + label if label in labelled else label
        labelled.add(label)
        if spell.by:
            low = at - 0.5 * _HELD_HEIGHT + step * judges.index(spell.by)
            axes.broken_barh(bar, (low, step), color=shades[spell.by], label=shown)
        else:
            axes.broken_barh(bar, (at - 0.5 * _FAULT_HEIGHT, _FAULT_HEIGHT), color=BLACK, alpha=0.2, label=shown)
    axes.set_yticks(range(len(targets)), reversed(targets))
    axes.set_ylim(-0.6, len(targets) - 0.4)
