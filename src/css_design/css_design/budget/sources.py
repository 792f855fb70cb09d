# SPDX-License-Identifier: Apache-2.0
"""Sources of error, and what of a mission switches each of them off."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from css_common.mission import Mission, MissionError
from css_design.errors import DesignError
from css_monte_carlo.mission_parts import Parts, parts_of
from css_sensors.calibrated_readings import is_calibrated
from css_sensors.cells import CELLS, NORMALS

LAYOUT = "layout"
"""What the place and view of the cells cost: against cells that look everywhere."""

FILTER = "filter"
"""What is left with perfect sensors and cells everywhere: lag, convergence, dark; of pointing, the control too."""

_DENSE_CELLS = 32
_DENSE_VIEW_DEG = 180.0
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


class Source(NamedTuple):
    """A source of error that sensors have."""

    name: str
    part: str  # of `Parts`: the sensor
    off: Mapping[str, object]  # parameter of the sensor to the value without it
    meaning: str


SOURCES = (
    Source("noise", "array", {"noise": 0.0}, "white noise of the cells"),
    Source("albedo", "array", {"albedo.enabled": False}, "light of the Earth on the cells"),
    Source(
        "calibration",
        "array",
        {
            "scale_common_error": 0.0,
            "scale_cell_error": 0.0,
            "scale": 1.0,
            "bias": 0.0,
            "fixed_degradation": 0.0,
            "degradation": 0.0,
            "warp": False,
            "thermal.coefficient": 0.0,
        },
        "scale, offset, response, losses and warmth of the cells",
    ),
    Source("misalignment", "array", {"misalignment_deg": 0.0}, "tilt of the cells"),
    Source("quantisation", "array", {"bits": 0, "dropout": 0.0}, "steps and threshold of the cells' converter"),
    Source(
        "gyro",
        "gyro",
        {
            "noise_deg_s": 0.0,
            "bias_deg_h": 0.0,
            "bias_walk_deg_s": 0.0,
            "scale_error": 0.0,
            "misalignment_deg": 0.0,
            "resolution_deg_s": 0.0,
        },
        "noise, bias, scale and steps of the gyro",
    ),
    Source(
        "magnetometer",
        "magnetometer",
        {"noise_nt": 0.0, "bias_nt": 0.0, "resolution_nt": 0.0},
        "noise, bias and steps of the magnetometer",
    ),
)
"""In the order of the table."""


def heard_sources(mission: Mission) -> tuple[Source, ...]:
    """Sources of the sensors that a mission has."""
    parts = parts_of(mission)
    return tuple(source for source in SOURCES if getattr(parts, source.part) is not None)


def refuse_calibrated(mission: Mission) -> None:
    """Raises where readings are corrected by a calibration: what it leaves of an error is not split.

    Raises:
        DesignError: they are.
    """
    if any(is_calibrated(node.values) for node in mission.nodes):
        raise DesignError(
            f"{mission.origin}: cells.measured, gyro.measured or magnetometer.measured given, but sensors are split "
            "that nobody has calibrated; expected a mission without them, with the errors that the calibration leaves"
        )


def known_response(mission: Mission) -> bool:
    """Whether the estimator reckons with the response and the losses of the cells, so that they are no error to it."""
    values = mission.node(mission.values.graph.estimator).values
    return hasattr(values, "response") and getattr(values.response, "curve", "cosine") != "cosine"


def without(mission: Mission, sources: Iterable[Source]) -> Mission:
    """The mission with some sources switched off."""
    parts = parts_of(mission)
    kept = {"warp", "degradation", "scale"} if known_response(mission) else set()
    overrides = [
        f"{_node(parts, source)}.{key}={_text(value)}"
        for source in sources
        for key, value in source.off.items()
        if key not in kept
    ]
    return mission.with_overrides(overrides)


def is_active(mission: Mission, source: Source) -> bool:
    """Whether a mission has anything of a source."""
    node = getattr(parts_of(mission), source.part)
    kept = {"warp", "degradation", "scale"} if known_response(mission) else set()
    return any(node.canonical[key] != value for key, value in source.off.items() if key not in kept)


def seeing_everywhere(mission: Mission) -> Mission | None:
    """The mission with cells all over the sphere that nothing hides; None where its estimator knows no such layout."""
    index = np.arange(_DENSE_CELLS) + 0.5
    z = 1.0 - 2.0 * index / _DENSE_CELLS
    across, azimuth = np.sqrt(1.0 - z**2), _GOLDEN * index
    normals = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], axis=1)
    array = parts_of(mission).array
    overrides = [
        f"cells.normals={','.join(repr(float(v)) for v in normals.ravel())}",
        f"cells.field_of_view_deg={_DENSE_VIEW_DEG}",
        "cells.clip_normal=0,0,0",
    ]
    for_each = [p for p in CELLS if p.is_array and p.length is None and p is not NORMALS]
    overrides += [f"{p.name}=" for p in for_each if len(mission.values[p])]
    if np.any(array.values.collar.axis):
        overrides += [f"{array.name}.collar.axis=0,0,0", f"{array.name}.collar.cells="]
    if mission.values.graph.estimator in ("flat", "pyramid_switch"):
        return None  # they go by faces
    try:
        return mission.with_overrides(overrides)
    except MissionError:
        return None  # a list with a value for each cell


def _node(parts: Parts, source: Source) -> str:
    return str(getattr(parts, source.part).name)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
