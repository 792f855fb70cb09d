# SPDX-License-Identifier: Apache-2.0
"""Coning angle and period from the Sun angles of the legs of a flight."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from css_common.codec import Sample
from css_common.component import Component, Input, Outgoing, Output, Received
from css_common.run import node_main
from css_common.schema import Values, real, reals
from css_estimation.spin.coning import Coning as ConingResult
from css_estimation.spin.coning import Passages, analyse_coning
from css_estimation.spin.coning_spectrum import MOST_CANDIDATES
from css_estimation.spin.slit_measurement import INERTIA_RATIO
from css_msgs.msg import ConingEstimate, SlitSunAngle
from css_sensors.slits import counts_between, head_azimuths, slit_inclination, timer_frequency

_COLUMNS = len(Passages._fields)
_LEGS = reals(
    "legs", (0.0, 1e6), "s", "windows of steady motion after the epoch, a row of start and end each", columns=2
)
_INTERVAL = real("interval", 30.0, "s", "time from estimate to estimate within a leg", low=0.1, high=1e6)


class Coning(Component):
    """Coning angle, period and its aliases over each leg: again and again while the leg lasts, and at its end."""

    shared = ("slits",)
    parameters = (_LEGS, _INTERVAL, INERTIA_RATIO)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (Input("angle", "slit_sun_angle/sun_angle", SlitSunAngle),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("coning", f"{name}/coning", ConingEstimate, ends_cycle=True),)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        edges = values[_LEGS].ravel()
        if not len(edges) or np.any(np.diff(edges) < 0.0) or np.any(values[_LEGS][:, 0] == values[_LEGS][:, 1]):
            yield f"legs: {edges.tolist()} given, expected rows of start and end, one after the other"

    def configure(self) -> None:
        self._leg = 0
        self._rows: list[tuple[float, ...]] = []
        self._due = math.inf
        self._fields: dict[str, Any] | None = None
        self._window = (0.0, 0.0)
        self._inclination = slit_inclination(self.values)
        self._azimuths = head_azimuths(self.values)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        angle = received["angle"]
        assert angle is not None  # a required input
        now = (stamp_ns - self.epoch_ns) * 1e-9
        fresh = False
        if self._leg < len(self.values[_LEGS]):
            start, end = self.values[_LEGS][self._leg].tolist()
            if angle.validity == SlitSunAngle.VALIDITY_VALID:
                self._take(angle, now, start, end)
            over = now >= end
            if over or now >= self._due:
                fresh = self._analyse(complete=over)
                self._due = now + self.values[_INTERVAL]
            if over:
                self._leg += 1
                self._rows.clear()
                self._due = math.inf
        return {"coning": self.message("coning", stamp_ns, **self._message_fields(now, fresh))}

    def _take(self, angle: Sample, now: float, start: float, end: float) -> None:
        time = now - angle.age
        if not start <= time < end:
            return
        if not self._rows:
            self._due = now + self.values[_INTERVAL]
        frequency = timer_frequency(self.values)
        upper = counts_between(angle.upper, angle.vertical) / frequency
        self._rows.append(
            (time, angle.sun_angle, angle.rate, upper, upper + angle.count / frequency, self._azimuths[angle.head])
        )

    def _analyse(self, complete: bool) -> bool:
        columns = np.array(self._rows).reshape(-1, _COLUMNS).T
        # several of one cycle may have come in another order
        passages = Passages(*columns[:, np.argsort(columns[0], kind="stable")])
        result = analyse_coning(passages, self._inclination, self.values[INERTIA_RATIO])
        if result is None:
            return False
        self._fields = {**estimate_fields(result), "leg": self._leg, "complete": int(complete)}
        self._window = result.start, result.end
        return True

    def _message_fields(self, now: float, fresh: bool) -> dict[str, Any]:
        if self._fields is None:
            nothing = {name: np.zeros(MOST_CANDIDATES) for name in ("frequency", "inertia_ratio", "power", "residual")}
            zeros = dict.fromkeys((
                "max_min_angle", "sine_angle", "full_angle", "period", "fft_period", "resolution", "spin",
                "sun_angle", "start", "end",
            ), 0.0)  # fmt: skip
            counts = dict.fromkeys(("samples", "candidates", "chosen", "choice", "leg", "complete"), 0)
            return {**nothing, **zeros, **counts, "validity": ConingEstimate.VALIDITY_NONE}
        return {
            **self._fields,
            "start": now - self._window[0],
            "end": now - self._window[1],
            "validity": ConingEstimate.VALIDITY_VALID if fresh else ConingEstimate.VALIDITY_HELD,
        }


def estimate_fields(result: ConingResult) -> dict[str, Any]:
    """Fields of css_msgs/ConingEstimate that an analysis fills."""
    chosen = result.candidates[result.chosen]
    return {
        "frequency": _padded([c.frequency for c in result.candidates]),
        "inertia_ratio": _padded([c.inertia_ratio for c in result.candidates]),
        "power": _padded([c.power for c in result.candidates]),
        "residual": _padded(result.residuals),
        "max_min_angle": result.max_min_angle,
        "sine_angle": result.sine.full_angle,
        "full_angle": result.full_angle,
        "period": 1.0 / chosen.frequency,
        "fft_period": 1.0 / chosen.sequence_frequency,
        "resolution": result.resolution,
        "spin": result.spin,
        "sun_angle": result.sun_angle,
        "samples": result.samples,
        "candidates": len(result.candidates),
        "chosen": result.chosen,
        "choice": result.choice,
    }


def _padded(values: Iterable[float]) -> np.ndarray:
    padded = np.zeros(MOST_CANDIDATES)
    given = list(values)
    padded[: len(given)] = given
    return padded


main = node_main(Coning)
