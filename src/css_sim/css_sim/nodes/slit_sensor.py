# SPDX-License-Identifier: Apache-2.0
"""Simulated slit sensor: one message a pulse, and one a cycle with the pulses of the cycle."""

from collections.abc import Iterator

import numpy as np

from css_common.attitude import mrp_to_dcm
from css_common.codec import Sample
from css_common.component import INERTIAL, Component, Input, Outgoing, Output, Received
from css_common.fault_lines import FAULTS, Units
from css_common.kernel import typed_call
from css_common.mission_section import CASE, PERIOD, SEED
from css_common.orbit_section import needed_of_orbit
from css_common.random_streams import random_key
from css_common.run import node_main
from css_common.schema import Values
from css_common.vectors import Vec3, vector_of
from css_msgs.msg import SlitPulse, SlitPulses, SpacecraftState
from css_sensors.payload import needed_of_payload
from css_sensors.slits import HEAD_AZIMUTHS, SLITS_PER_HEAD, TIMER_SPAN
from css_sim import failing, slit_faults, slit_timer
from css_sim.failing import Failing, fault_outputs
from css_sim.slit_crossings import slit_crossings, slit_geometry
from css_sim.slit_faults import Cycle, FaultyHeads, Pulse
from css_sim.spinning_payload import payload_motion, payload_state

_SUNLIT = 0.5
_AGREEMENT = 1e-6  # [-] of attitude matrices


class SlitSensor(Component):
    """Timer counts at which the Sun crosses the slits of each head (Reichard et al., ESPRIT).

    Crossings between two stamps are found on the motion that the payload section describes, the one that the truth
    is sampled from; a truth of another motion is refused.
    """

    shared = ("orbit", "payload", "slits")
    parameters = (*slit_timer.PARAMETERS, *failing.PARAMETERS)
    fault_kinds = slit_faults.KINDS
    _failing = Failing(())  # of a node that has not begun

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        used = ("sigma_bn", "sun_n", "illumination")
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL, used=used),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        pulses = Output("step", "slits/step", SlitPulses), Output("pulse", "slits/pulse", SlitPulse, events=True)
        return (*pulses, *fault_outputs(name, values))

    @classmethod
    def fault_units(cls, values: Values) -> Units:
        return slit_faults.units(values)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return (*needed_of_orbit(values), *needed_of_payload(values))

    def configure(self) -> None:
        values = self.values
        self._key = random_key(values[SEED], values[CASE])
        self._timer = slit_timer.parameters(values)
        self._faults = slit_faults.of_case(values, self._key)
        faults = self._faults.of(values[FAULTS])
        self._failing = Failing(faults, self._failing)
        self._heads_in_flight = FaultyHeads(faults, self._key, self._timer.frequency)
        self._motion = payload_motion(values, self.epoch_ns, self._key)
        self._geometry = slit_geometry(values)
        turns = self._motion.fastest * values[PERIOD] / (2.0 * np.pi)
        room = int(np.ceil(turns + 1.0)) * SLITS_PER_HEAD * len(values[HEAD_AZIMUTHS])
        self._times = np.zeros(room)
        self._slits, self._heads = np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
        self._ticks, self._codes = np.zeros(2 * room, dtype=np.int64), np.zeros((2 * room, 2), dtype=np.int64)
        self._crossings, self._read = typed_call(slit_crossings), typed_call(slit_timer.read_pulses)
        self._state, self._to_dcm = typed_call(payload_state), typed_call(mrp_to_dcm)
        # compiled here, not at the first stamp: the loop would wait
        self._pulses_between((1.0, 0.0, 0.0), 0, 0.0, 0.0)

    def tune(self, values: Values) -> None:
        super().tune(values)
        self._timer = slit_timer.parameters(values)
        faults = self._faults.of(values[FAULTS])
        self._failing.take(faults)
        self._heads_in_flight.faults = faults

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        truth = received["truth"]
        assert truth is not None  # a required input
        end = (stamp_ns - self.epoch_ns) * 1e-9
        self._check(truth, end)
        pulses = 0
        if truth.illumination > _SUNLIT:
            start = max((stamp_ns - self.period_ns - self.epoch_ns) * 1e-9, 0.0)
            pulses = self._pulses_between(vector_of(truth.sun_n), self.step_of(stamp_ns), start, end)
        ticks, codes = self._ticks[:pulses], self._codes[:pulses]
        faults = self._heads_in_flight
        if faults.is_needed:
            ticks, codes = self._spoiled(faults, stamp_ns, ticks, codes)
        return {**self._messages(stamp_ns, ticks, codes), **self._failing.told(self, stamp_ns)}

    def _spoiled(
        self, faults: FaultyHeads, stamp_ns: int, ticks: np.ndarray, codes: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Counts and codes of the pulses that come in spite and because of faults."""
        cycle = Cycle(
            self.step_of(stamp_ns), self._count_at(stamp_ns - self.period_ns) + 1, self._count_at(stamp_ns) + 1
        )
        given = [Pulse(t, *c) for t, c in zip(ticks.tolist(), codes.tolist(), strict=True)]
        come = faults.pulses(cycle, given)
        return np.array([p.ticks for p in come], np.int64), np.array([p[1:] for p in come], np.int64).reshape(-1, 2)

    def _count_at(self, stamp_ns: int) -> int:
        """Whole counts since the epoch at a stamp."""
        # a millionth of a count, so that rounding does not cut a count that ends at the stamp
        return int((stamp_ns - self.epoch_ns) * self._timer.frequency * 1e-9 + 1e-6)

    def _pulses_between(self, sun_n: Vec3, step: int, start: float, end: float) -> int:
        """Writes the pulses of one step into ticks and codes; returns their number."""
        crossings = self._crossings(
            self._motion, self._geometry, sun_n, start, end, self._times, self._slits, self._heads
        )
        pulses: int = self._read(
            self._timer, self._key, step, crossings,
            self._times, self._slits, self._heads, self._ticks, self._codes,
        )  # fmt: skip
        return pulses

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        return {**self._messages(stamp_ns, self._ticks[:0], self._codes[:0]), **self._failing.told(self, stamp_ns)}

    def _check(self, truth: Sample, elapsed_s: float) -> None:
        of_truth = np.array(self._to_dcm(vector_of(truth.sigma_bn)))
        of_motion = np.array(self._state(self._motion, elapsed_s).dcm_bn)
        off = float(np.max(np.abs(of_truth - of_motion)))
        if off > _AGREEMENT:
            raise ValueError(
                f"the truth at {elapsed_s:g} s is not the motion of the payload section (attitudes differ by {off:.2g} "
                "in an element): the slit sensor flies with css_sim/rocket and the same mission"
            )

    def _messages(self, stamp_ns: int, ticks: np.ndarray, codes: np.ndarray) -> Outgoing:
        timer = self._count_at(stamp_ns) % TIMER_SPAN
        step = self.message(
            "step",
            stamp_ns,
            timer=timer,
            count=(ticks % TIMER_SPAN).astype(np.uint32),
            slit=codes[:, 0].astype(np.uint32),
            head=codes[:, 1].astype(np.uint32),
        )
        return {"step": step, "pulse": tuple(self._pulses(ticks, codes))}

    def _pulses(self, ticks: np.ndarray, codes: np.ndarray) -> Iterator[Sample]:
        for count, (slit, head) in zip(ticks.tolist(), codes.tolist(), strict=True):
            instant = self.epoch_ns + round(count * 1e9 / self._timer.frequency)
            yield self.message("pulse", instant, count=count % TIMER_SPAN, slit=slit, head=head)


main = node_main(SlitSensor)
