# SPDX-License-Identifier: Apache-2.0
"""Which units failed at each step of a flight that was not flown in the loop, and which cells showed it."""

from collections.abc import Iterator

import numpy as np

from css_analysis.fault_record import FaultRecord
from css_analysis.flight_log import FlightLog
from css_common.codec import Sample
from css_common.fault_lines import FAULTS
from css_common.kernel import typed_call
from css_common.mission import Mission, Node
from css_common.stepping import Stepper
from css_estimation.sun.sun_heading import LEFT_FIELD, LEFT_GYRO
from css_monte_carlo.failing_units import NOTHING_FAILS, Failing, evident_cells
from css_sim import sun_cells
from css_sim.nodes.css_array import CssArray

_LEFT = {"gyro": LEFT_GYRO, "magnetometer": LEFT_FIELD}
_PLACES = {"wheel": "wheels", "tachometer": "wheels", "rod": "rods"}
_DRAWN = "random_faults."


def failing_by_step(log: FlightLog) -> list[Failing]:
    """The units that failed at each step of the truth of a flight, by the faults that its nodes told."""
    truth = log.having("truth")
    failing = [NOTHING_FAILS] * len(truth)
    for record in log.faults:
        first = _step(record.begin_s, log.period)
        end = len(truth) if record.end_s is None else _step(record.end_s, log.period)
        for step in range(first, min(end, len(truth))):
            failing[step] = _with(failing[step], record)
    if any(f.cells for f in failing):
        _note_evident(log, failing)
    return failing


def _step(time_s: float, period_s: float) -> int:
    return round(time_s / period_s) if period_s > 0.0 else 0


def _with(failing: Failing, record: FaultRecord) -> Failing:
    sort, _, unit = record.target.partition(".")
    if sort in _LEFT:
        return failing._replace(sensors=failing.sensors | _LEFT[sort])
    bits = 1 << int(unit)
    if sort == "cell":
        if record.kind == "swapped":
            bits |= 1 << int(record.values["other"][0])
        return failing._replace(cells=failing.cells | bits)
    place = _PLACES.get(sort)
    return failing if place is None else failing._replace(**{place: getattr(failing, place) | bits})


def _note_evident(log: FlightLog, failing: list[Failing]) -> None:
    """Has the failed cells that show it in what failed, where the log has what the cells read."""
    mission, voltages = log.mission, log.voltages
    array = None if mission is None else _array_of(mission)
    if mission is None or voltages is None or array is None:
        return
    rows, steps = log.truth_rows(voltages)
    row_of = dict(zip(steps.tolist(), rows.tolist(), strict=True))
    p, evident = sun_cells.parameters(array.values), typed_call(evident_cells)
    for step, of_step in enumerate(_healthy_cells(log, mission, array)):
        cells = failing[step].cells
        if cells and of_step is not None and step in row_of:
            healthy, albedo = of_step
            shown = evident(p, cells, healthy, voltages.voltages[row_of[step]], albedo)
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
