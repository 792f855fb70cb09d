# SPDX-License-Identifier: Apache-2.0
"""The units that nodes of a flight held for failed, as they told it on `health/NODE`, and whether they were right."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from css_analysis.fault_record import FaultRecord
from css_common.codec import Sample
from css_common.health_words import DONE_WORDS, EVIDENCE_WORDS, KIND_WORDS, LEFT_OUT, unit_name

_WHOLE = ("gyro", "magnetometer")  # sensors whose axes fail together, for those who leave them out
_PART_OF = {"tachometer": "wheel"}


class HealthRecord(NamedTuple):
    """One unit that a node held for failed.

    Attributes:
        node: who did.
        target: the unit, such as `cell.3`.
        kind: what it was last taken for, in words.
        evidence: what showed it, in words.
        statistic, threshold: of that evidence; None: nobody told.
        shown_s: when the statistic was first beyond its threshold [s] after the epoch; None: nobody told.
        begin_s: first stamp at which the unit was held for failed [s].
        end_s: first stamp at which it was used again; None: it was not.
        done: what the node did about it.
        names: when it was taken for what [s], a number of css_msgs/Faults or `KIND_UNKNOWN`.
    """

    node: str
    target: str
    kind: str
    evidence: str
    statistic: float | None
    threshold: float | None
    shown_s: float | None
    begin_s: float
    end_s: float | None
    done: str = LEFT_OUT
    names: tuple[tuple[float, int], ...] = ()

    def text(self) -> str:
        """One line for people."""
        until = "" if self.end_s is None else f", used again at {self.end_s:g} s"
        beyond = ""
        if self.statistic is not None:
            beyond = f" ({self.statistic:.4g}, more than {self.threshold:.4g}, from {self.shown_s:g} s on)"
        found = f"{self.node}: {self.target} {self.kind}, at {self.begin_s:g} s: {self.evidence}{beyond}"
        return f"{found}; {self.done}{until}"


def health_records(node: str, told: Iterable[Sample], epoch_ns: int) -> list[HealthRecord]:
    """What a node held for failed, of its messages `Health` in the order of their stamps."""
    records: list[HealthRecord] = []
    held: dict[tuple[int, int], int] = {}
    for message in told:
        now_s = (message.stamp_ns - epoch_ns) / 1e9
        verdicts = {(sort, unit): rest for sort, unit, *rest in _verdicts_of(message)}
        for key in list(held):
            if key not in verdicts:
                index = held.pop(key)
                records[index] = records[index]._replace(end_s=now_s)
        for key, (kind, evidence, statistic, threshold, shown_s) in verdicts.items():
            word = KIND_WORDS.get(kind, f"kind {kind}")
            if key in held:
                known = records[held[key]]
                if known.names[-1][1] != kind:
                    records[held[key]] = known._replace(kind=word, names=(*known.names, (now_s, kind)))
                continue
            held[key] = len(records)
            shows = EVIDENCE_WORDS.get(evidence, f"evidence {evidence}")
            done = DONE_WORDS.get(key[0], LEFT_OUT)
            records.append(
                HealthRecord(
                    node,
                    unit_name(*key),
                    word,
                    shows,
                    statistic,
                    threshold,
                    shown_s,
                    now_s,
                    None,
                    done,
                    ((now_s, kind),),
                )
            )
    return records


def _verdicts_of(message: Sample) -> Iterator[tuple]:
    names = zip(*(getattr(message, name).tolist() for name in ("sort", "unit", "kind", "evidence")), strict=False)
    rows = message.rows[: len(message.rows) // 3 * 3].reshape(-1, 3).tolist()
    for name, row in zip(names, rows, strict=False):
        yield (*name, *row)


def untold_record(node: str, target: str, begin_s: float, end_s: float | None) -> HealthRecord:
    """Of a unit that a node left out without telling why."""
    return HealthRecord(node, target, "failed", "nobody tells why", None, None, None, begin_s, end_s)


class Detection(NamedTuple):
    """What a node found, beside the truth.

    Attributes:
        health: what it held for failed; None: nothing, where a fault acted.
        fault: what acted; None: nothing did, or nobody knows.
        truth_known: whether all faults of the flight are known.
    """

    health: HealthRecord | None
    fault: FaultRecord | None
    truth_known: bool = True

    @property
    def is_false(self) -> bool:
        """Whether a unit was held for failed on which no fault acted."""
        return self.truth_known and self.fault is None

    @property
    def after_s(self) -> float | None:
        """Time from the begin of a fault to when its unit was held for failed [s]; None: it was not."""
        return None if self.health is None or self.fault is None else self.health.begin_s - self.fault.begin_s

    def text(self) -> str:
        """One line for people."""
        if self.health is None:
            assert self.fault is not None
            return f"{self.fault.text()}: not detected"
        if self.fault is not None:
            return f"{self.health.text()}; it is {self.fault.kind}: detected after {self.after_s:.6g} s"
        return self.health.text() + ("; false: no fault acts on it" if self.truth_known else "")


def detections(
    health: Sequence[HealthRecord], faults: Sequence[FaultRecord], truth_known: bool = True
) -> list[Detection]:
    """Everything that was held for failed with what acted when it began, and the faults for which nothing was.

    A fault of one axis of gyro or magnetometer is found by whoever leaves out the sensor, one of a tachometer by
    whoever leaves out its wheel.

    Args:
        truth_known: whether `faults` are all that acted.
    """
    found: list[Detection] = []
    for record in health:
        acting = [fault for fault in faults if _is_of(fault, record.target) and _acts(fault, record.begin_s)]
        found.append(Detection(record, acting[-1] if acting else None, truth_known))
    known = {id(detection.fault) for detection in found}
    unfound = [fault for fault in faults if id(fault) not in known and not _found_before(fault, health)]
    return found + [Detection(None, fault) for fault in unfound]


def _found_before(fault: FaultRecord, health: Iterable[HealthRecord]) -> bool:
    """Whether a unit was held for failed while a fault of it acted, be it for another."""
    return any(
        _is_of(fault, record.target)
        and (fault.end_s is None or record.begin_s < fault.end_s)
        and (record.end_s is None or record.end_s > fault.begin_s)
        for record in health
    )


def _acts(fault: FaultRecord, time_s: float) -> bool:
    return fault.begin_s <= time_s and (fault.end_s is None or time_s < fault.end_s)


def _is_of(fault: FaultRecord, target: str) -> bool:
    sort, _, unit = target.partition(".")
    failed, _, number = fault.target.partition(".")
    if sort in _WHOLE:
        return failed == sort
    if _PART_OF.get(failed, failed) != _PART_OF.get(sort, sort):
        return False
    other = fault.values.get("other")
    return number == unit or (fault.kind == "swapped" and other is not None and f"{other[0]:g}" == unit)
