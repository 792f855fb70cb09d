# SPDX-License-Identifier: Apache-2.0
"""Safe-hold Sun estimator on flat-mounted cells alone (Benton, section III); its modes are in `safe_hold`."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from css_common.declared import builder, computed, part, table_of
from css_common.kernel import kernel
from css_common.schema import Values
from css_estimation.sun import flat_faces, sun_tracking
from css_estimation.sun.cell_layout import brightest
from css_estimation.sun.eclipse_detector import detect_eclipse
from css_estimation.sun.flat_faces import FLAT_CELLS, faces_of_cells, flat_heading
from css_estimation.sun.safe_hold import DEFAULTS, MODE_FLAT, MODE_NO_SUN, CellsVerdict, finish_safe_hold
from css_estimation.sun.sun_algorithm import no_memory
from css_estimation.sun.sun_heading import Aiding, SunHeading
from css_estimation.sun.sun_tracking import TrackingParameters, TrackingState, elapsed


class FlatParameters(NamedTuple):
    """All of the estimator."""

    faces: np.ndarray = computed(faces_of_cells, FLAT_CELLS)  # (N,) face of each cell
    tracking: TrackingParameters = part(TrackingParameters)


PARAMETERS = table_of(FlatParameters, **DEFAULTS)
parameters = builder(FlatParameters)


def conflicts(values: Values) -> Iterator[str]:
    """What is wrong between the values, one message each."""
    return flat_faces.conflicts(values)


initial_memory = no_memory


def initial_state(p: FlatParameters) -> TrackingState:
    """No estimate yet."""
    return sun_tracking.initial_state()


@kernel
def step(
    p: FlatParameters,
    state: TrackingState,
    memory: None,
    dt: float,
    voltages,
    aiding: Aiding,
) -> tuple[TrackingState, SunHeading]:
    """One cycle; arguments in `css_estimation.sun.sun_algorithm`."""
    dt = elapsed(dt)
    top = brightest(voltages)
    largest = voltages[top] if top >= 0 else 0.0
    shadow = detect_eclipse(p.tracking.eclipse, state.eclipse, dt, largest, aiding.sky.predicted)
    sun_b, mask = flat_heading(p.faces, voltages)
    verdict = CellsVerdict(sun_b, mask, MODE_FLAT if mask != 0 else MODE_NO_SUN, False)
    return finish_safe_hold(p.tracking, state, dt, aiding, shadow, verdict)
