# SPDX-License-Identifier: Apache-2.0
"""Which units failed at each step of a flight that was not flown in the loop, and which cells showed it."""

from collections.abc import Iterator

import numpy as np

from css_analysis.flight_log import FlightLog
from css_common.case_faults import NEVER
from css_common.codec import Sample
from css_common.fault_lines import FAULTS
from css_common.kernel import typed_call
from css_common.mission import Mission
from css_common.mission_node import Node
from css_common.stepping import Stepper
from css_monte_carlo.failing_units import NOTHING_FAILS, Failing, evident_cells, failing_units, uncertainty_of
from css_monte_carlo.health_tallies import UNITS
from css_sim.fault_effects import FAULT
from css_sim.fault_kinds import AXES, KINDS, SORTS
from css_sim.nodes.css_array import CssArray

_CODES = {(kind.sort, kind.name): kind.code for kind in KINDS}
_DRAWN = "random_faults."


def fault_table(log: FlightLog) -> np.ndarray:
    """The faults (F,) of FAULT of a flight that its nodes told; of their values the first, as it was said."""
    table = np.zeros(len(log.faults), FAULT)
    known = 0
    for record in log.faults:
        sort, _, unit = record.target.partition(".")
        code = _CODES.get((sort, record.kind))
        if code is None:
            continue
        row = table[known]
        row["sort"], row["kind"] = SORTS[sort], code
        row["unit"] = AXES.index(unit) if unit in AXES else int(unit)
        row["value"] = next((value for value, _ in record.values.values()), 0.0)
        row["first_step"] = _step(record.begin_s, log.period)
        row["end_step"] = NEVER if record.end_s is None else _step(record.end_s, log.period)
        known += 1
    return table[:known]


def failing_by_step(log: FlightLog, table: np.ndarray) -> list[Failing]:
    """The units that faults (F,) of FAULT act on at each step of the truth of a flight."""
    units = typed_call(failing_units)
    failing = [units(table, step) if len(table) else NOTHING_FAILS for step in range(len(log.having("truth")))]
    if any(f.cells for f in failing):
        _note_evident(log, failing)
    return failing


def _step(time_s: float, period_s: float) -> int:
    return round(time_s / period_s) if period_s > 0.0 else 0


def _note_evident(log: FlightLog, failing: list[Failing]) -> None:
    """Has the failed cells that show it in what failed, where the log has what the cells read."""
    mission, voltages = log.mission, log.voltages
    array = None if mission is None else _array_of(mission)
    if mission is None or voltages is None or array is None:
        return
    rows, steps = log.truth_rows(voltages)
    row_of = dict(zip(steps.tolist(), rows.tolist(), strict=True))
    uncertainty, evident = uncertainty_of(array.values), typed_call(evident_cells)
    for step, of_step in enumerate(_healthy_cells(log, mission, array)):
        cells = failing[step].cells
        if cells and of_step is not None and step in row_of:
            healthy, albedo = of_step
            shown = evident(uncertainty, cells, healthy, voltages.voltages[row_of[step]], albedo)
            failing[step] = failing[step]._replace(cells_evident=shown)


def _array_of(mission: Mission) -> Node | None:
    arrays = [node for node in mission.nodes if node.component is CssArray]
    return arrays[0] if len(arrays) == 1 else None


def _healthy_cells(log: FlightLog, mission: Mission, array: Node) -> Iterator[tuple[np.ndarray, np.ndarray] | None]:
    """What the cells would have read at each step of the truth without faults, and the light of the Earth on them."""
    events = [event for event in mission.events if not _is_fault(event.parameter)]
    canonical = {**array.canonical, FAULTS.name: [], f"{_DRAWN}count": 0}
    stepper = Stepper(array.component, array.name, canonical, events, mission.epoch_ns)
    truth = log.having("truth")
    (heard,) = array.inputs
    for row, stamp_ns in enumerate(truth.stamp_ns.tolist()):
        sample = Sample(stamp_ns, "")
        for name in heard.used:
            value = getattr(truth, name)[row]
            sample.__dict__[name] = value if np.ndim(value) else float(value)
        said = stepper.step(stamp_ns, {heard.key: sample}).get("voltages")
        component = stepper.component
        assert isinstance(component, CssArray)
        yield (said.voltages, component.albedo) if isinstance(said, Sample) else None


def _is_fault(parameter: str) -> bool:
    return parameter == FAULTS.name or parameter.startswith(_DRAWN)


def cell_kinds_by_step(log: FlightLog, node: str) -> Iterator[np.ndarray]:
    """What an estimator takes each cell for at each step of the truth: (32,) rows with `kind`, as it told it."""
    told = sorted(
        (time_s, int(record.target.partition(".")[2]), kind)
        for record in log.health
        if record.node == node and record.target.startswith("cell.")
        for time_s, kind in record.names
    )
    kinds = np.zeros(UNITS, [("kind", np.int64)])
    for step in range(len(log.having("truth"))):
        while told and _step(told[0][0], log.period) <= step:
            _, cell, kind = told.pop(0)
            kinds["kind"][cell] = kind
        yield kinds
