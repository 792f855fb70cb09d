# SPDX-License-Identifier: Apache-2.0
"""What a node of a sensor does for its latency: it remembers the truths that it hears."""

from css_common.kernel import typed_call
from css_common.random_streams import RandomKey
from css_common.vectors import Vec3
from css_sim.latency import Latency, Moment, draw_lag, longest_lag, new_history, remember, sensed

_NOTHING: Vec3 = (0.0, 0.0, 0.0)


class Delayed:
    """Truths of the last cycles, of which the one that is due is told."""

    def __init__(self, p: Latency, key: RandomKey, sensor: int) -> None:
        """Draws the latency of the case; `sensor` as in `latency`."""
        self._lag = draw_lag(p, key, sensor)
        self._history = new_history(longest_lag(p))
        self._remember, self._sensed = typed_call(remember), typed_call(sensed)

    def __call__(
        self,
        step: int,
        *,
        sigma_bn: Vec3 = _NOTHING,
        omega_bn_b: Vec3 = _NOTHING,
        sun_n: Vec3 = _NOTHING,
        intensity: float = 0.0,
        field_n: Vec3 = _NOTHING,
    ) -> Moment:
        """What the sensor senses at a control cycle at which there is this; what it does not sense may be left out."""
        now = Moment(sigma_bn, omega_bn_b, sun_n, intensity, field_n)
        if self._lag <= 0.0:
            return now
        self._remember(self._history, step, now)
        return self._sensed(self._history, step, self._lag, now, 0)
