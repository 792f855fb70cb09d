# SPDX-License-Identifier: Apache-2.0
"""Benton's cells for tests of its estimators: a model of their outputs, written apart from the simulation's."""

import math
from pathlib import Path

import numpy as np

from css_common.mission import load_mission
from css_common.schema import default_values
from css_common.sections import SPACECRAFT
from css_estimation.sun import flat_cells, pyramid_switch
from css_sensors.cells import CELLS

CONFIG = Path(__file__).parents[3] / "config"
SHARED = CELLS + SPACECRAFT


def layout(name):
    """Normals (14, 3) and array normal of a mission file."""
    values = load_mission(CONFIG / f"{name}.yaml").values
    return values.cells.normals, values.spacecraft.array_normal


FLAT_NORMALS, PANEL = layout("clark_1996_flat")
NORMALS, _ = layout("clark_1996_pyramid")
PYRAMID = (11, 12, 13)


def build(algorithm, **changes):
    """Parameters and initial state of an algorithm on the cells of its mission."""
    normals = NORMALS if algorithm is pyramid_switch else FLAT_NORMALS
    changes.setdefault("cells__normals", normals.ravel().tolist())
    changes.setdefault("spacecraft__array_normal", PANEL.tolist())
    changes.setdefault("cells__clip_normal", [0.0, 0.0, 0.0])
    p = algorithm.parameters(default_values(SHARED + algorithm.PARAMETERS, **changes))
    return p, algorithm.initial_state(p)


def outputs(*sources, normals=NORMALS, noise=None):
    """Outputs (14,) in the light of sources, vectors in b of their strength: collar, sum, drop-out, noise, 12 bits."""
    light = np.zeros(len(normals))
    for source in map(np.asarray, sources):
        size = np.linalg.norm(source)
        part = np.maximum(normals @ source, 0.0)
        if normals is NORMALS and size > 0.0:
            full, dark = math.cos(math.radians(28.0)), math.cos(math.radians(44.9))
            part[list(PYRAMID)] *= np.clip((source @ PANEL / size - dark) / (full - dark), 0.0, 1.0)
        light += part
    light[light < math.sin(math.radians(7.0))] = 0.0
    if noise is not None:
        light = light + noise
    return np.clip(np.floor(light * 4096.0) / 4096.0, 0.0, 4095.0 / 4096.0)


def off_panel(angle_deg, azimuth_deg=0.0):
    """Unit vector at an angle from the panel normal."""
    e1 = np.array([1.0, 0.0, 0.0])
    e2 = np.cross(PANEL, e1)
    a, b = math.radians(angle_deg), math.radians(azimuth_deg)
    return math.cos(a) * PANEL + math.sin(a) * (math.cos(b) * e1 + math.sin(b) * e2)


FLAT, SWITCH = flat_cells, pyramid_switch
