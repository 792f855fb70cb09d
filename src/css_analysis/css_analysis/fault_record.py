# SPDX-License-Identifier: Apache-2.0
"""The faults that acted in a flight, as its sensors and actuators told them on `faults/NODE`."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from css_common import link_kinds
from css_common.case_faults import NEVER, CaseFault
from css_common.codec import Sample
from css_common.fault_lines import Units
from css_sim.fault_kinds import AXES, KINDS, SORTS

_CODES = {**SORTS, **link_kinds.SORTS}
_KINDS = {(_CODES[kind.sort], kind.code): kind for kind in (*KINDS, *link_kinds.KINDS)}
_SORTS = {code: name for name, code in _CODES.items()}
_AXES: Units = {"gyro": AXES, "magnetometer": AXES}


class FaultRecord(NamedTuple):
    """One fault of one unit.

    Attributes:
        target: what failed, such as `cell.3`.
        kind: its name, or its number where this version knows none.
        values: value and unit by name, as the mission's units have it.
        begin_s: first stamp at which it acted [s] after the epoch.
        end_s: first stamp at which it did no more; None: it acted to the end.
    """

    target: str
    kind: str
    values: dict[str, tuple[float, str]]
    begin_s: float
    end_s: float | None

    def text(self) -> str:
        """One line for people."""
        values = "".join(
            f", {name} {value:.6g}" + (f" {unit}" if unit != "-" else "") for name, (value, unit) in self.values.items()
        )
        until = f" to {self.end_s:g} s" if self.end_s is not None else " s on"
        return f"{self.target} {self.kind}{values}, from {self.begin_s:g}{until}"


def fault_records(told: Iterable[Sample], epoch_ns: int, names: Units | None = None) -> list[FaultRecord]:
    """The faults of messages `Faults` of one node, in the order of their stamps.

    Args:
        told: the messages.
        epoch_ns: stamp from which times count.
        names: of units that have more than a number, by their sort.
    """
    known = {**_AXES, **(names or {})}
    records: list[FaultRecord] = []
    acting: dict[tuple, int] = {}
    for message in told:
        now_s = (message.stamp_ns - epoch_ns) / 1e9
        faults = list(_faults_of(message))
        for fault in list(acting):
            if fault not in faults:
                index = acting.pop(fault)
                records[index] = records[index]._replace(end_s=now_s)
        for fault in faults:
            if fault not in acting:
                acting[fault] = len(records)
                records.append(_record(fault, now_s, known))
    return records


def case_record(fault: CaseFault, period_s: float, names: Units) -> FaultRecord:
    """A fault of a case as its flight would tell it.

    Args:
        fault: which begins at some time.
        period_s: control cycle [s].
        names: of the units of its node, by their sort.
    """
    told = (fault.sort, fault.unit, fault.kind, *fault.values)
    record = _record(told, fault.first_step * period_s, names)
    return record._replace(end_s=None if fault.end_step >= NEVER else fault.end_step * period_s)


def _faults_of(message: Sample) -> Iterator[tuple]:
    units = zip(message.sort.tolist(), message.unit.tolist(), message.kind.tolist(), strict=False)
    rows = message.rows[: len(message.rows) // 4 * 4].reshape(-1, 4).tolist()
    for unit, row in zip(units, rows, strict=False):
        yield (*unit, *row)


def _record(fault: tuple, now_s: float, names: Units) -> FaultRecord:
    sort, unit, code, *values = fault
    kind = _KINDS.get((sort, code))
    sort_name = _SORTS.get(sort, f"unit of sort {sort}")
    of_sort = names.get(sort_name, ())
    target = f"{sort_name}.{of_sort[unit] if unit < len(of_sort) else unit}"
    if kind is None:
        return FaultRecord(target, f"fault {code}", {}, now_s, None)
    named = zip(kind.values, values, strict=False)
    return FaultRecord(target, kind.name, {v.parameter.name: (x, v.parameter.unit) for v, x in named}, now_s, None)


def fault_texts(records: Iterable[FaultRecord]) -> list[str]:
    """A line for each fault; units that fail alike and together share one."""
    texts: dict[str, list[str]] = {}
    for record in records:
        texts.setdefault(record._replace(target="").text(), []).append(record.target)
    return [f"{', '.join(dict.fromkeys(targets))}{text}" for text, targets in texts.items()]
