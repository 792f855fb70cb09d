# SPDX-License-Identifier: Apache-2.0
"""A sensor of somebody else's driver, brought into the graph: body frame, SI units, stamps of this clock."""

import time
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from css_common.codec import Sample
from css_common.component import Component, Input, Outgoing, Output, Received, Standing
from css_common.schema import Values
from css_drivers import mounting
from css_drivers.latency_record import LatencyRecord
from css_drivers.mounting import MAX_AGE, SENSOR_FRAME, STAMPS, sensor_to_body, turned_covariance


class Relay(Component):
    """Passes the messages of one sensor on.

    Class attributes:
        from_topic: where its driver publishes; `-r` remaps it.
        to_topic: where the graph listens.
        message_type: of both.
        vector: field that holds the measurement.
        units: factor to SI by name.
    """

    shared: ClassVar[tuple[str, ...]] = ()
    from_topic: ClassVar[str]
    to_topic: ClassVar[str]
    message_type: ClassVar[type]
    vector: ClassVar[str]
    units: ClassVar[Mapping[str, float]]

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        return (
            Input(
                "sensor",
                cls.from_topic,
                cls.message_type,
                required=False,
                used=(cls.vector,),
                restamped=values[STAMPS] == "arrival",
                sensor_frame=values[SENSOR_FRAME],
            ),
        )

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("measured", cls.to_topic, cls.message_type),)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return mounting.conflicts(values)

    def configure(self) -> None:
        self._matrix = sensor_to_body(self.values)
        self._scale = self.units[self.values.unit]
        self._max_age_ns = round(self.values[MAX_AGE] * 1e9)
        self._counts = Counter({"passed_on": 0})
        self._age = LatencyRecord()
        self._heard = time.monotonic()

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        message = received["sensor"]
        assert message is not None  # the only input
        self._heard = time.monotonic()
        age_ns = self.now_ns() - stamp_ns
        if abs(age_ns) > self._max_age_ns:
            self._counts["left_out_old" if age_ns > 0 else "left_out_ahead"] += 1
            if self._counts["left_out_old"] + self._counts["left_out_ahead"] == 1:
                self.report(
                    f"{self.from_topic}: a message {age_ns * 1e-9:+.3f} s old when it came is left out, max_age is "
                    f"{self.values[MAX_AGE]:g} s (stamps: arrival is for drivers whose clock is another)"
                )
            return {}
        self._age.note(age_ns)
        self._counts["passed_on"] += 1
        return {"measured": self.message("measured", stamp_ns, **self._turned(message))}

    def _turned(self, message: Sample) -> dict[str, Any]:
        """All fields of the message, the measurement in body and SI."""
        fields = {key: value for key, value in vars(message).items() if key not in ("stamp_ns", "frame_id")}
        covariance = f"{self.vector}_covariance"
        fields[self.vector] = self._scale * (self._matrix @ fields[self.vector])
        fields[covariance] = turned_covariance(self._matrix, fields[covariance], self._scale)
        return fields

    def standing(self) -> Standing:
        """Counts, how old messages are when they come, and how long none has."""
        figures = {**self._counts, **self._age.figures("age")}
        silent = time.monotonic() - self._heard
        if silent > self.values[MAX_AGE]:
            return Standing(f"no message of {self.from_topic} for {silent:.1f} s", True, figures)
        left_out = self._counts["left_out_old"] + self._counts["left_out_ahead"]
        if left_out:
            return Standing(f"{left_out} messages too old or ahead of the clock left out", False, figures)
        return Standing(figures=figures)


NOTHING = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
"""Covariance of what there is no estimate of."""
