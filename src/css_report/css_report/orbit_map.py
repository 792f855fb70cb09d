# SPDX-License-Identifier: Apache-2.0
"""The orbit over the Earth, and the light of Sun and Earth along it."""

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np

from css_analysis.cell_outputs import NO_ERRORS, Cells
from css_analysis.flight_log import FlightLog
from css_analysis.palette import BLACK, BLUE, ORANGE
from css_common.mission_node import Node
from css_common.random_streams import random_key
from css_environment.earth_rotation import dcm_en_at
from css_environment.reflectivity import reflectivity_at
from css_report.blocks import Block, Plot
from css_report.flight_plots import Scene
from css_report.looks import TRUE, Look, look
from css_report.traces import Trace, dots, line
from css_sim import earth_reflectivity

_POINTS = 720  # of the track
_LIGHT_POINTS = 240  # at which the light of the Earth is worked out again
_STEP_DEG = 5.0  # of the map of reflectivity
_X = {"range": [-180.0, 180.0], "tickvals": [-180, -120, -60, 0, 60, 120, 180], "constrain": "domain"}
_Y = {"range": [-90.0, 90.0], "tickvals": [-90, -60, -30, 0, 30, 60, 90]}


def orbit_blocks(scene: Scene) -> Iterator[Block]:
    """Track, light of the Sun and light of the Earth; nothing without a place."""
    log = scene.log
    if log.truth is None or log.imported or not np.any(log.truth.r_n):
        return
    array = _simulated_cells(log)
    rows = np.unique(np.linspace(0, len(log.truth) - 1, _POINTS).astype(int))
    height_km = 1e-3 * np.linalg.norm(log.truth.r_n[rows], axis=1)
    yield _track(scene, rows, array)
    yield scene.plot(
        "illumination",
        "Light of the Sun",
        "part of the solar disc in view",
        [line("true", scene.time(log.truth), log.truth.illumination, TRUE)],
        y={"range": [-0.05, 1.05]},
        height=180,
        caption=f"Distance from the centre of the Earth {height_km.min():.0f} to {height_km.max():.0f} km.",
    )
    if array is not None:
        yield from _earthlight(scene, array)


def _simulated_cells(log: FlightLog) -> Node | None:
    """The node that simulates the cells, with light of the Earth."""
    for node in log.mission.nodes if log.mission is not None else ():
        if hasattr(node.values, "albedo") and hasattr(node.values, "collar"):
            return node
    return None


def places(log: FlightLog, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(K, 2) longitude and latitude [deg] below the spacecraft, and below the Sun, at rows (K,) of the truth."""
    truth = log.having("truth")
    below, under_sun = np.empty((len(rows), 2)), np.empty((len(rows), 2))
    for k, row in enumerate(rows.tolist()):
        dcm_en = np.array(dcm_en_at(int(truth.stamp_ns[row])))
        below[k], under_sun[k] = _lon_lat(dcm_en @ truth.r_n[row]), _lon_lat(dcm_en @ truth.sun_n[row])
    return below, under_sun


def _lon_lat(direction_e: np.ndarray) -> tuple[float, float]:
    x, y, z = direction_e
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arctan2(z, np.hypot(x, y))))


def _track(scene: Scene, rows: np.ndarray, array: Node | None) -> Plot:
    log = scene.log
    below, under_sun = places(log, rows)
    lit = log.sunlit[rows]
    traces: list[Trace] = []
    caption = "Latitude is geocentric."
    if array is not None:
        traces.append(_reflectivity(log, array))
        albedo = array.values.albedo
        caption += f" Shades: reflectivity of the Earth that flew ({albedo.reflectivity}, times {albedo.factor:g})."
    for word, i, of in (("start", 0, Look(BLUE, "dot")), ("end", -1, Look(BLUE, "dashdot"))):
        traces.append(_wrapped(f"day and night, {word}", _terminator(under_sun[i]), of, 1.2))
    traces += [
        _wrapped("track in sunlight", np.where(lit[:, None], below, np.nan), Look(ORANGE, "solid"), 3.2),
        _wrapped("track in eclipse", np.where(lit[:, None], np.nan, below), Look(BLACK, "dot"), 3.0),
        dots("start", [below[0, 0]], [below[0, 1]], Look(BLACK, marker="triangle-up"), size=13),
        dots("end", [below[-1, 0]], [below[-1, 1]], Look(BLACK, marker="square"), size=11),
        dots("Sun overhead, start", [under_sun[0, 0]], [under_sun[0, 1]], Look(ORANGE, marker="star"), size=15),
    ]
    return Plot(
        "orbit", "The orbit over the Earth", traces, "longitude [deg]", "latitude [deg]",
        x=_X, y=_Y, caption=caption, height=440,
    )  # fmt: skip


def _terminator(under_sun: np.ndarray) -> np.ndarray:
    """(N, 2) longitudes and latitudes [deg] where the Sun stands on the horizon."""
    lon, lat = np.radians(under_sun)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    return np.array([_lon_lat(np.cos(t) * east + np.sin(t) * north) for t in turn])


def _reflectivity(log: FlightLog, array: Node) -> Trace:
    values = array.values
    grid = earth_reflectivity.source(values, log.epoch_ns)
    drawn = earth_reflectivity.case_reflectivity(values, grid, random_key(values.mission.seed, values.mission.case))
    lon = np.arange(-180.0 + 0.5 * _STEP_DEG, 180.0, _STEP_DEG)
    lat = np.arange(-90.0 + 0.5 * _STEP_DEG, 90.0, _STEP_DEG)
    across, up = np.meshgrid(np.radians(lon), np.radians(lat))
    at = np.stack((np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), np.sin(up)), axis=-1).reshape(-1, 3)
    seen = np.array([reflectivity_at(drawn, tuple(direction.tolist())) for direction in at])
    return {
        "type": "heatmap", "x": lon, "y": lat, "z": np.asarray(seen.reshape(across.shape), np.float32),
        "colorscale": [[0.0, "#b9c0c8"], [1.0, "#fdfdfd"]], "showscale": False, "zmin": 0.0, "zmax": 1.0,
        "hovertemplate": "reflectivity %{z:.2f}<extra></extra>",
    }  # fmt: skip


def _wrapped(name: str, at: np.ndarray, of: Look, width: float) -> Trace:
    jumps = np.flatnonzero(np.abs(np.diff(at[:, 0])) > 180.0) + 1
    at = np.insert(at, jumps, np.nan, axis=0)
    return {
        "type": "scatter", "mode": "lines", "name": name, "x": np.asarray(at[:, 0], np.float32),
        "y": np.asarray(at[:, 1], np.float32), "line": {"color": of.colour, "dash": of.dash, "width": width},
        "hoverinfo": "name",
    }  # fmt: skip


def _earthlight(scene: Scene, array: Node) -> Iterator[Block]:
    log = scene.log
    if not array.values.albedo.enabled:
        yield f"{array.name} flew without light of the Earth (albedo.enabled is false)."
        return
    rows, outputs = earthlight(log, array.name)
    time = log.time(log.having("truth"))[rows] / scene.unit.scale
    traces = [line(f"cell {i}", time, outputs[:, i], look(i)) for i in range(outputs.shape[1])]
    yield scene.plot(
        "earthlight", "Light of the Earth on the cells", "output [-], 1: the Sun at normal incidence", traces,
        caption=f"Worked out again at {len(rows)} steps of the flight, by the chain of {array.name} without Sun, noise "
        "and degradation.",
    )  # fmt: skip


def earthlight(log: FlightLog, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the truth (K,), and outputs (K, N) of the cells there by the light of the Earth alone.

    Args:
        log: the flight, with its mission.
        name: of the node that simulates the cells.
    """
    assert log.mission is not None
    truth = log.having("truth")
    cells = Cells(log.mission, name, *(f"{name}.{error}" for error in NO_ERRORS))
    rows = np.unique(np.linspace(0, len(truth) - 1, _LIGHT_POINTS).astype(int))
    outputs = []
    for row in rows.tolist():
        place = SimpleNamespace(
            r_n=truth.r_n[row], sun_n=truth.sun_n[row], solar_flux=float(truth.solar_flux[row]), illumination=0.0
        )
        outputs.append(cells.outputs(float(log.time(truth)[row]), place, truth.sigma_bn[row]))
    return rows, np.array(outputs)
