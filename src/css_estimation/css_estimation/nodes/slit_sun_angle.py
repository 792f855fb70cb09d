# SPDX-License-Identifier: Apache-2.0
"""Sun angle and rotation rate from the pulses of slits."""

from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np

from css_common.codec import Sample
from css_common.component import Component, Input, Outgoing, Output, Received
from css_common.kernel import typed_call
from css_common.run import node_main
from css_common.schema import Values
from css_estimation.spin import slit_measurement, slit_passage
from css_estimation.spin.slit_measurement import HALF_COUNT, SunAngle
from css_estimation.spin.slit_passage import HIGHEST_SPIN, LOWEST_SPIN, REASON_NONE, REASON_UNKNOWN, Passage
from css_estimation.spin.slit_timer_counts import UnwrappedTimer
from css_estimation.symmetric import row_major
from css_msgs.msg import SlitPulses, SlitSunAngle
from css_sensors.slits import TIMER_SPAN, UPPER, head_azimuths


class SlitPassages(Component):
    """Signed Sun angle, Sun vector and rate at each passage through the slits (Reichard et al., ESPRIT, Eqs. 2 to 7).

    A measurement goes out in the cycle of its last pulse; several of one cycle, in the cycles that follow.
    """

    shared = ("slits",)
    parameters = slit_measurement.PARAMETERS

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (Input("pulses", "slits/step", SlitPulses),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("angle", f"{name}/sun_angle", SlitSunAngle, ends_cycle=True),)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        if values[LOWEST_SPIN] >= values[HIGHEST_SPIN]:
            yield f"lowest_spin_hz: {values[LOWEST_SPIN]:g} given, expected less than highest_spin_hz"
        passages = len(values.slits.head_azimuths_deg) * values[HIGHEST_SPIN]
        if passages * values.mission.period > 1.0:
            yield (
                f"highest_spin_hz: up to {passages:g} passages a second are more than one in a mission.period of "
                f"{values.mission.period:g} s"
            )

    def configure(self) -> None:
        self._p = slit_measurement.parameters(self.values)
        self._azimuths = head_azimuths(self.values)
        self._heads = [slit_passage.initial_state() for _ in self._azimuths]
        self._swing = slit_measurement.initial_swing(self._p)
        self._timer = UnwrappedTimer()
        self._waiting: deque[tuple[int, Passage, SunAngle]] = deque(maxlen=64)
        self._newest: tuple[int, Passage, SunAngle] | None = None
        self._refused = 0
        self._take, self._measure = typed_call(slit_passage.take_pulse), typed_call(slit_measurement.measure)
        # compiled here, not at the first passage: the loop would wait
        self._take(self._p.passage, self._heads[0], UPPER, 0)
        self._measure(self._p, self._swing, Passage(True, REASON_NONE, 0, 1, 0, 0), 0.0)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        pulses = received["pulses"]
        assert pulses is not None  # a required input
        reason = self._take_all(pulses)
        timer = self._timer.follow(int(pulses.timer))
        validity = SlitSunAngle.VALIDITY_NONE if self._newest is None else SlitSunAngle.VALIDITY_HELD
        if self._waiting:
            self._newest = self._waiting.popleft()
            validity = SlitSunAngle.VALIDITY_VALID
        return {"angle": self.message("angle", stamp_ns, **self._fields(timer, validity, reason))}

    def _take_all(self, pulses: Sample) -> int:
        if not len(pulses.count) == len(pulses.slit) == len(pulses.head):
            self._refused += 1
            return REASON_UNKNOWN
        last_reason = REASON_NONE
        for count, slit, head in zip(pulses.count.tolist(), pulses.slit.tolist(), pulses.head.tolist(), strict=True):
            if head >= len(self._heads):
                reason = REASON_UNKNOWN
            else:
                self._heads[head], passage = self._take(
                    self._p.passage, self._heads[head], slit, self._timer.follow(count)
                )
                reason = passage.reason
                if passage.measured:
                    self._swing, angle = self._measure(self._p, self._swing, passage, self._azimuths[head])
                    self._waiting.append((head, passage, angle))
            if reason != REASON_NONE:
                self._refused += 1
                last_reason = reason
        return last_reason

    def _fields(self, timer: int, validity: int, reason: int) -> dict[str, Any]:
        common = {"refused": self._refused, "validity": validity, "reason": reason}
        if self._newest is None:
            nothing = {name: 0.0 for name in ("sun_angle", "sun_angle_sigma", "rate", "age")}
            counts = {name: 0 for name in ("count", "turn", "upper", "vertical", "head")}
            return {"sun_b": np.zeros(3), "covariance": np.zeros(9), **nothing, **counts, **common}
        head, passage, angle = self._newest
        return {
            "sun_b": np.array(angle.sun_b),
            "covariance": np.array(row_major(angle.covariance)),
            "sun_angle": angle.angle,
            "sun_angle_sigma": angle.sigma,
            "rate": angle.rate,
            "age": max(0.0, (timer - passage.vertical - HALF_COUNT) / self._p.frequency),
            "count": passage.interval,
            "turn": passage.turn,
            "upper": passage.upper % TIMER_SPAN,
            "vertical": passage.vertical % TIMER_SPAN,
            "head": head,
            **common,
        }


main = node_main(SlitPassages)
