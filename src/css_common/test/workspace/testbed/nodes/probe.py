# SPDX-License-Identifier: Apache-2.0
"""A device whose readings a test puts into a queue; an exception among them is raised, in the device's thread."""

from queue import Empty, SimpleQueue
from typing import ClassVar

import numpy as np

from css_common.component import Outgoing, Output, Received
from css_common.device import READING, Device, Reading, Stop
from css_common.schema import Values
from css_msgs.msg import CssVoltages


class Probe(Device):
    """Publishes what it is told to have read."""

    parameters = ()
    told: ClassVar[SimpleQueue] = SimpleQueue()
    begun: ClassVar[list[str]] = []
    noted: ClassVar[list[Reading]] = []

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("voltages", "voltages", CssVoltages, may_lack=("voltages",)),)

    def readings(self, stop: Stop):
        self.begun.append("begin")
        try:
            while not stop:
                try:
                    told = self.told.get(timeout=0.01)
                except Empty:
                    continue
                if isinstance(told, Exception):
                    raise told
                yield told
        finally:
            self.begun.append("end")

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        voltages = np.array(received[READING].value)
        return {"voltages": self.message("voltages", stamp_ns, saturated=0, voltages=voltages)}

    def published(self, reading: Reading) -> None:
        self.noted.append(reading)
