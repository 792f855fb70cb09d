# SPDX-License-Identifier: Apache-2.0
"""The Sun's way over the body sphere, with the field of view of each cell and how many cells cover what."""

from collections.abc import Iterator

import numpy as np

from css_analysis.body_axes import axes_about, map_coordinates
from css_analysis.flight_log import FlightLog, angle
from css_analysis.palette import BLACK, ORANGE, VERMILION
from css_common.schema import Values
from css_environment.albedo import Screen, is_blocked, transmission, view_cosine
from css_report.blocks import Block, Plot, Table
from css_report.looks import OUTLINES, Look, look
from css_report.traces import Trace, dots
from css_sensors.cells import half_view_cosine
from css_sim.cell_screen import cell_sides, screen

_STEP_DEG = 1.0  # of the map of coverage
_LEAST_WAY = np.radians(0.5)  # between points of a path that are drawn
_SAME_COS = np.cos(np.radians(3.0))  # labels of cells that look less apart would cover one another
_MOST_POINTS = 6000  # of a path; a longer one is drawn with wider steps
_X = {"range": [0.0, 360.0], "tickvals": [0, 60, 120, 180, 240, 300, 360], "constrain": "domain"}
_Y = {"range": [180.0, 0.0], "tickvals": [0, 30, 60, 90, 120, 150, 180]}
_OF_CELLS = (
    "Shades: how many cells see a direction, dark: none. Numbers: where cells look; their lines: how far they see."
)


def body_blocks(log: FlightLog) -> Iterator[Block]:
    """The map and the coverage; nothing when it is unknown where cells look and where the Sun was."""
    axes = axes_about(log.array_normal_b)
    traces: list[Trace] = []
    cells = _cell_values(log)
    coverage = None if cells is None else seen_by(cells, _directions(axes))
    if cells is not None and coverage is not None:
        traces.append(_coverage_trace(coverage))
        traces += _views(cells, axes)
    paths = list(_paths(log, axes))
    if not traces and not paths:
        return
    yield Plot(
        "body-map",
        "The Sun's way over the body",
        [*traces, *paths],
        "azimuth about the array normal [deg]",
        "angle from the array normal [deg]",
        x=_X,
        y=_Y,
        caption=" ".join(["The top edge is the array normal.", *([] if coverage is None else [_OF_CELLS])]),
        height=460,
    )
    if coverage is not None:
        yield coverage_table(coverage)


def _cell_values(log: FlightLog) -> Values | None:
    """Values of a node that simulates cells, which know the screen too; None: the mission has none."""
    for node in log.mission.nodes if log.mission is not None else ():
        if hasattr(node.values, "cells") and hasattr(node.values, "collar") and len(node.values.cells.normals):
            return node.values
    return None


def _grid() -> tuple[np.ndarray, np.ndarray]:
    """Azimuths (A,) and polar angles (P,) [deg] of the middles of the map's fields."""
    half = 0.5 * _STEP_DEG
    return np.arange(half, 360.0, _STEP_DEG), np.arange(half, 180.0, _STEP_DEG)


def _directions(axes: np.ndarray) -> np.ndarray:
    """(P, A, 3) unit vectors in b of the middles of the map's fields."""
    azimuth, polar = (np.radians(a) for a in np.meshgrid(*_grid()))
    at = np.stack((np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)), axis=-1)
    return at @ axes


def seen_by(values: Values, directions_b: np.ndarray) -> np.ndarray:
    """(...) number of cells that see each direction (..., 3) in b: in the cone of view, not hidden by the screen.

    Args:
        values: of a node with the sections `cells` and `collar`.
        directions_b: unit vectors.
    """
    flat = directions_b.reshape(-1, 3)
    counts = np.zeros(len(flat), np.uint8)
    for inside in views(values, flat):
        counts += inside
    return counts.reshape(directions_b.shape[:-1])


def views(values: Values, directions_b: np.ndarray) -> Iterator[np.ndarray]:
    """(N,) whether each cell in turn sees directions (N, 3) in b."""
    hidden_by, limit = screen(values), half_view_cosine(values)
    for i, (normal, side) in enumerate(zip(values.cells.normals, cell_sides(values), strict=True)):
        inside = directions_b @ normal >= view_cosine(hidden_by, i, limit)
        rows = np.flatnonzero(inside)
        inside[rows] = [_passes(hidden_by, i, float(side), directions_b[row]) for row in rows]
        yield inside


def _passes(hidden_by: Screen, i: int, side: float, direction_b: np.ndarray) -> bool:
    """Whether light from a direction passes what is in front of a cell."""
    x, y, z = direction_b.tolist()
    return transmission(hidden_by, side, (x, y, z)) > 0.0 and not is_blocked(hidden_by, i, (x, y, z))


def _coverage_trace(coverage: np.ndarray) -> Trace:
    azimuth, polar = _grid()
    most = max(int(coverage.max()), 1)
    # grey from dark to light: it says the same without colour
    return {
        "type": "heatmap", "x": azimuth, "y": polar, "z": coverage, "zmin": 0, "zmax": most,
        "showscale": False, "colorscale": [[0.0, "#5a5f66"], [1.0, "#f2f4f6"]], "zsmooth": False,
        "hovertemplate": "%{z} cells<extra></extra>",
    }  # fmt: skip


def _views(values: Values, axes: np.ndarray) -> Iterator[Trace]:
    """The edge of the view of each cell, and where it looks."""
    turn, of_all = np.radians(np.arange(0.0, 361.0, 3.0)), half_view_cosine(values)
    hidden_by, sides = screen(values), cell_sides(values)
    for i, normal in enumerate(values.cells.normals):
        own, half = axes_about(normal), np.arccos(view_cosine(hidden_by, i, of_all))
        edge = np.column_stack(
            (np.sin(half) * np.cos(turn), np.sin(half) * np.sin(turn), np.full(len(turn), np.cos(half)))
        )
        edge_b = edge @ own
        seen = np.array([_passes(hidden_by, i, float(sides[i]), e) for e in edge_b])
        at = map_coordinates(axes, edge_b)
        at[~seen] = np.nan
        stroke = {
            "color": look(i).colour,
            "dash": OUTLINES[i % len(OUTLINES)],
            "width": 1.6 + 0.8 * (i // len(OUTLINES)),
        }
        yield _broken(at, {"name": f"view of cell {i}", "line": stroke})
    alike = _alike(values.cells.normals)
    at = map_coordinates(axes, np.array([values.cells.normals[cells[0]] for cells in alike]).reshape(-1, 3))
    labels = [",".join(map(str, cells)) for cells in alike]
    sizes = [max(19, 8 * len(label) + 6) for label in labels]
    # a label of several cells stays inside the map, beside which the axis has its numbers
    inside = [0.3 * size if len(cells) > 1 else 0.0 for size, cells in zip(sizes, alike, strict=True)]
    across = np.clip(at[:, 0], inside, 360.0 - np.array(inside))
    yield {
        "type": "scatter", "mode": "markers+text", "name": "where cells look", "x": across.tolist(),
        "y": at[:, 1].tolist(), "text": labels, "textposition": "middle center",
        "textfont": {"color": "#ffffff", "size": 12, "weight": 700}, "hoverinfo": "text",
        "marker": {"symbol": "circle", "size": sizes, "color": "#30363c", "line": {"color": "#ffffff", "width": 1}},
        "cliponaxis": False,
    }  # fmt: skip


def _alike(normals: np.ndarray) -> list[list[int]]:
    """Numbers of the cells that look the same way, which have one label."""
    alike: list[list[int]] = []
    for i, normal in enumerate(normals):
        same = next((cells for cells in alike if np.dot(normals[cells[0]], normal) > _SAME_COS), None)
        if same is None:
            alike.append([i])
        else:
            same.append(i)
    return alike


def _paths(log: FlightLog, axes: np.ndarray) -> Iterator[Trace]:
    """True Sun while it shines, and what the estimator that flew made of it."""
    if log.truth is not None:
        sunlit = np.where(log.sunlit[:, None], log.sun_b, np.nan)
        time_s = log.time(log.truth)
        yield from _path("true Sun", sunlit, time_s, axes, Look(BLACK, "solid"), ends=True)
    name = log.flown if log.flown in log.estimates else next(iter(log.estimates), None)
    if name is not None:
        columns = log.estimates[name]
        known = np.where((columns.validity != 0)[:, None], columns.sun_b, np.nan)
        yield from _path(f"Sun by {name}", known, log.time(columns), axes, Look(VERMILION, "dot"), ends=False)


def _path(name: str, sun_b: np.ndarray, time_s: np.ndarray, axes: np.ndarray, of: Look, ends: bool) -> Iterator[Trace]:
    rows = path_rows(sun_b)
    if not np.isfinite(sun_b[rows]).any():
        return
    at = map_coordinates(axes, sun_b[rows])
    yield _broken(at, {"name": name, "line": {"color": of.colour, "dash": of.dash, "width": 1.2 if ends else 1.1}})
    if ends:
        known = np.flatnonzero(np.isfinite(at[:, 0]))
        for word, i, symbol in (("start", known[0], "triangle-up"), ("end", known[-1], "star")):
            text = f"{word}: {time_s[rows[i]]:.0f} s"
            yield dots(text, [at[i, 0]], [at[i, 1]], Look(ORANGE, marker=symbol), [text], 14)


def path_rows(directions: np.ndarray) -> np.ndarray:
    """Rows (K,) of directions (N, 3) that are drawn: the next is half a degree or more of way on.

    No part of the way is cut: between two rows that are drawn the direction has gone no further than that. A way of
    more points than a plot can hold has wider steps. Not a number: a gap.
    """
    known = np.isfinite(directions[:, 0])
    ways = np.zeros(len(directions))
    ways[1:] = np.nan_to_num(angle(directions[1:], directions[:-1]))
    way = np.cumsum(ways)
    step = max(_LEAST_WAY, float(way[-1]) / _MOST_POINTS) if len(way) else _LEAST_WAY
    bins = np.floor(way / step)
    new = np.diff(bins, prepend=-1.0) != 0.0
    turns = np.diff(known.astype(np.int8), prepend=2) != 0
    last = np.append(turns[1:], True)
    return np.flatnonzero(new | turns | last)


def _broken(at: np.ndarray, more: Trace) -> Trace:
    """A line in the map, (N, 2) azimuth and polar angle, with a gap where it goes over its edge."""
    jumps = np.flatnonzero(np.abs(np.diff(at[:, 0])) > 180.0) + 1
    at = np.insert(at, jumps, np.nan, axis=0)
    return {
        "type": "scatter", "mode": "lines", "x": np.asarray(at[:, 0], np.float32),
        "y": np.asarray(at[:, 1], np.float32), "hoverinfo": "name", **more,
    }  # fmt: skip


def coverage_table(coverage: np.ndarray) -> Table:
    """Share of the sphere that so many cells see, of a map of rings of equal width."""
    polar = np.radians(_grid()[1])
    share = np.sin(polar) / (np.sin(polar).sum() * coverage.shape[1])
    lines = []
    for count in range(int(coverage.max()) + 1):
        lines.append([f"{count}", f"{100.0 * float(share @ np.count_nonzero(coverage == count, axis=1)):.1f}"])
    return Table(["cells that see a direction", "share of the sphere [%]"], lines)
