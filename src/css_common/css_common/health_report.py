# SPDX-License-Identifier: Apache-2.0
"""Tells on `health/NODE`, and in the log, which units a component holds for failed, whenever that changes."""

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from css_common.codec import Sample
from css_common.component import Component, Output
from css_common.health import Verdict, verdicts_of
from css_common.health_words import EVIDENCE_WORDS, KIND_WORDS, unit_name
from css_msgs.msg import Health

_KEY = "health"


def health_output(name: str) -> Output:
    """The topic on which a node tells what it holds for failed."""
    return Output(_KEY, f"health/{name}", Health, events=True)


class HealthReport:
    """What a component has last said of its units."""

    def __init__(self, done: Callable[[Verdict], str] = lambda verdict: "left out") -> None:
        """Nothing said yet.

        Args:
            done: what is done about a unit that is held for failed, for the log.
        """
        self._done = done
        self._rows: bytes | None = None
        self._told: dict[tuple[int, int], tuple[Verdict, int]] = {}  # by sort and unit, with the stamp of since_step

    def told(self, component: Component, stamp_ns: int, rows: np.ndarray, step: int) -> dict[str, Sample]:
        """A message, and lines of the component's report, if verdicts are others than those of the last call.

        Args:
            component: has `health_output`.
            rows: (N,) of `css_common.health.VERDICT` after the cycle of this stamp.
            step: number of that cycle, as the algorithm counts them in `since_step`.
        """
        now = rows.tobytes()
        if now == self._rows:
            return {}
        first, self._rows = self._rows is None, now
        verdicts = {(verdict.sort, verdict.unit): verdict for verdict in verdicts_of(rows)}
        before, self._told = self._told, {}
        for key, verdict in verdicts.items():
            known = before.get(key)
            if known is None or known[0].since_step != verdict.since_step:
                since_ns = stamp_ns - (step - verdict.since_step) * component.period_ns
            else:
                since_ns = known[1]
            self._told[key] = (verdict, since_ns)
        component.left_out = tuple(unit_name(*key) for key in self._told)
        begins = first and _is_first(component, stamp_ns)
        if not verdicts and begins:
            return {}
        for line in self._lines(component, stamp_ns, before):
            component.report(line)
        return {_KEY: component.message(_KEY, stamp_ns, **self._fields(component))}

    def _fields(self, component: Component) -> dict[str, np.ndarray]:
        told = list(self._told.values())

        def column(name: str) -> np.ndarray:
            return np.array([getattr(verdict, name) for verdict, _ in told], np.uint32)

        table = [(v.statistic, v.threshold, (since_ns - component.epoch_ns) * 1e-9) for v, since_ns in told]
        return {
            **{name: column(name) for name in ("sort", "unit", "kind", "evidence")},
            "rows": np.array(table, dtype=np.float64).ravel(),
        }

    def _lines(
        self, component: Component, stamp_ns: int, before: Mapping[tuple[int, int], tuple[Verdict, int]]
    ) -> Iterable[str]:
        now_s = (stamp_ns - component.epoch_ns) * 1e-9
        for key, (verdict, since_ns) in self._told.items():
            name, kind = unit_name(*key), KIND_WORDS.get(verdict.kind, str(verdict.kind))
            known = before.get(key)
            if known is None:
                since_s = (since_ns - component.epoch_ns) * 1e-9
                evidence = EVIDENCE_WORDS.get(verdict.evidence, str(verdict.evidence))
                yield (
                    f"{name} held for failed at {now_s:g} s, {kind}: {evidence} ({verdict.statistic:.4g}, more than "
                    f"{verdict.threshold:.4g}, from {since_s:g} s on); {self._done(verdict)}"
                )
            elif known[0].kind != verdict.kind:
                yield f"{name} at {now_s:g} s: taken for {kind}, no longer for {KIND_WORDS.get(known[0].kind)}"
        for key in before:
            if key not in self._told:
                yield f"{unit_name(*key)} used again at {now_s:g} s"


def _is_first(component: Component, stamp_ns: int) -> bool:
    """Whether a stamp is that of the first cycle of a flight: before it nobody has said anything."""
    return component.step_of(stamp_ns) == 0
