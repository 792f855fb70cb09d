# SPDX-License-Identifier: Apache-2.0
"""Outputs of cells, 1 for the Sun met head-on, from what they read: volts, amperes or counts."""

import math

import numpy as np

from css_telemetry.columns import Readings
from css_telemetry.description import CellForm, Description
from css_telemetry.faults import Broken


def cell_outputs(readings: Readings, description: Description, full_scale: float | None) -> np.ndarray:
    """(N, C) outputs, NaN where they are missing; what is beyond numbers or lookup tables is counted and missing.

        (reading - dark level) / (full scale (1 + coefficient (temperature - reference)))

    Args:
        readings: of the table.
        description: its cells.
        full_scale: of all cells, above what the description says.
    """
    outputs = np.empty((len(readings.stamps_ns), len(description.cells)))
    for index, cell in enumerate(description.cells):
        outputs[:, index] = _outputs(readings, cell, full_scale)
    return outputs


def _outputs(readings: Readings, cell: CellForm, full_scale: float | None) -> np.ndarray:
    given = readings.values[cell.column]
    known = np.isfinite(given)
    if cell.lookup is not None and full_scale is None:
        x, y = cell.lookup
        output = np.interp(given, x, y)
        lost = known & ((given < x[0]) | (given > x[-1]))
        reason = f"column {cell.column}: a reading outside of the lookup table, {x[0]:g} to {x[-1]:g}"
        kind = "outside of the lookup table"
    else:
        scale = full_scale if full_scale is not None else cell.full_scale if cell.full_scale is not None else 1.0
        with np.errstate(over="ignore", invalid="ignore"):
            output = (given - (cell.dark_level or 0.0)) / scale
        lost = known & ~np.isfinite(output)
        reason, kind = "a cell output over its full scale is beyond all numbers", "no number"
    output = np.where(known & ~lost, output, math.nan)
    _count(readings, lost, kind, reason)
    if cell.thermal is not None:
        output = _at_reference(readings, cell, output)
    return output


def _at_reference(readings: Readings, cell: CellForm, output: np.ndarray) -> np.ndarray:
    """Outputs as they would be at the reference temperature; unknown where the temperature is."""
    assert cell.thermal is not None
    temperature = readings.values[cell.thermal.column]
    factor = 1.0 + cell.thermal.coefficient * (temperature - cell.thermal.reference)
    impossible = np.isfinite(output) & (factor <= 0.0)
    detail = f"column {cell.thermal.column}: a temperature at which cell {cell.name} would give nothing"
    _count(readings, impossible, "impossible temperature", detail)
    unknown = np.isfinite(output) & np.isnan(temperature)
    readings.account.note_missing("cell outputs without a temperature", readings.lines, unknown)
    return np.where(factor > 0.0, output / np.where(factor > 0.0, factor, 1.0), math.nan)


def _count(readings: Readings, lost: np.ndarray, kind: str, detail: str) -> None:
    for index in np.flatnonzero(lost).tolist():
        readings.account.repair(int(readings.lines[index]), Broken(kind, detail))
