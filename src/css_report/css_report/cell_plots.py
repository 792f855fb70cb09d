# SPDX-License-Identifier: Apache-2.0
"""The cells against time: what they put out, who used which of them, which failed and which were held for failed."""

from collections.abc import Iterator

import numpy as np

from css_analysis.flight_log import FlightLog
from css_analysis.palette import BLACK
from css_analysis.unit_spells import Spell, rank, spells
from css_report.blocks import Plot
from css_report.flight_plots import Scene
from css_report.looks import Look, look
from css_report.traces import Trace, bars, line, spans_of

_RESOLVED = 1500  # gaps shorter than this part of the flight cannot be seen
_FAILS = Look(BLACK, "solid")


def cell_plots(scene: Scene) -> Iterator[Plot]:
    """Outputs, masks and health, as far as the flight has them."""
    cells = scene.log.voltages
    if cells is not None:
        time = scene.time(cells)
        traces = [line(f"cell {i}", time, cells.voltages[:, i], look(i)) for i in range(cells.voltages.shape[1])]
        yield scene.plot("cells", "Cell output", "output [-], 1: the Sun at normal incidence", traces, height=300)
    masks = _masks(scene)
    if masks is not None:
        yield masks
    units = _units(scene)
    if units is not None:
        yield units


def _least_gap(scene: Scene) -> float:
    return (scene.unit.last - scene.unit.first) / _RESOLVED


def _masks(scene: Scene) -> Plot | None:
    """Which cells contributed to the estimate that flew, which were left out, which were at their limit."""
    log = scene.log
    name = log.flown if log.flown in log.estimates else next(iter(log.estimates), None)
    if name is None:
        return None
    columns, count = log.estimates[name], _cells(log, name)
    time, gap = scene.time(columns), _least_gap(scene)
    ordinates = range(count)
    traces = [
        bars(f"used by {name}", _bits(time, columns.lit_mask, ordinates, 0.0), look(0)._replace(marker=""), 7.0, gap),
        bars(
            "left out for failed", _bits(time, columns.isolated, ordinates, 0.22), Look("#D55E00", marker="x"), 3.0, gap
        ),
    ]
    if log.voltages is not None:
        limit = _bits(scene.time(log.voltages), log.voltages.saturated, ordinates, -0.22)
        traces.append(bars("at its upper limit", limit, Look("#009E73", "solid", "diamond"), 3.0, gap))
    traces = [trace for trace in traces if len(trace["x"])]
    if not traces:
        return None
    ticks = {"tickvals": list(ordinates), "ticktext": [f"cell {i}" for i in ordinates], "range": [count - 0.4, -0.6]}
    caption = "Gaps shorter than a point of the plot are closed." if _closes_gaps(scene, columns.lit_mask) else ""
    return scene.plot(
        "masks", f"Cells that {name} used", "cell", traces, y=ticks, height=90 + 26 * count, caption=caption
    )


def _closes_gaps(scene: Scene, masks: np.ndarray) -> bool:
    """Whether a mask changes more often than can be drawn."""
    return int(np.count_nonzero(np.diff(masks))) > _RESOLVED


def _cells(log: FlightLog, name: str) -> int:
    if log.voltages is not None:
        return int(log.voltages.voltages.shape[1])
    ever = int(np.bitwise_or.reduce(log.estimates[name].lit_mask | log.estimates[name].isolated))
    return max(ever.bit_length(), 1)


def _bits(
    time: np.ndarray, masks: np.ndarray, units: range, above: float
) -> dict[float, tuple[np.ndarray, np.ndarray]]:
    """Spans in which a bit is set, by the ordinate of its unit."""
    spans = {unit - above: spans_of(time, (masks >> np.uint32(unit) & 1) != 0) for unit in units}
    return {at: found for at, found in spans.items() if len(found[0])}


def _units(scene: Scene) -> Plot | None:
    """Units that failed, and who held them for failed when."""
    found = spells(scene.log)
    if not found:
        return None
    targets = sorted({spell.target for spell in found}, key=rank)
    judges = sorted({spell.by for spell in found if spell.by})
    traces: list[Trace] = []
    for i, by in enumerate(("", *judges)):
        shift = 0.0 if not by else 0.3 * i / (len(judges) + 1) + 0.1
        of = _FAILS if not by else look(i - 1)
        rows = {
            targets.index(target) - shift: _ends(scene, [s for s in found if s.target == target and s.by == by])
            for target in targets
            if any(s.target == target and s.by == by for s in found)
        }
        if rows:
            name = f"held for failed by {by}" if by else "fails"
            traces.append(bars(name, rows, of, 3.0 if by else 8.0, 0.0))
    ticks = {"tickvals": list(range(len(targets))), "ticktext": targets, "range": [len(targets) - 0.4, -0.8]}
    return scene.plot(
        "units", "Units that fail, and that are held for failed", "unit", traces, y=ticks, height=90 + 34 * len(targets)
    )


def _ends(scene: Scene, found: list[Spell]) -> tuple[np.ndarray, np.ndarray]:
    scale, last = scene.unit.scale, scene.unit.last
    found = sorted(found, key=lambda spell: spell.begin_s)
    begin = np.array([spell.begin_s / scale for spell in found])
    end = np.array([last if spell.end_s is None else spell.end_s / scale for spell in found])
    return begin, np.maximum(end, begin)
