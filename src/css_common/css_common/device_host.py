# SPDX-License-Identifier: Apache-2.0
"""The node around a device: a thread reads it, the node's own thread makes messages of what was read.

The thread lives from activation to deactivation. It touches nothing of the node: readings go through a queue, and the
executor is asked to come for them, so that nothing polls and a bus that hangs holds no service up.
"""

import threading
from queue import Empty, SimpleQueue

from css_common.device import READING, Device, Reading, Stop
from css_common.host import ComponentNode

_PATIENCE = 5.0  # wall time [s] within which a device must notice that it is to stop
_AFTER_FAILURE = 1.0  # wall time [s]
_MOST_WAITING = 64  # readings; more than that means that the node does not come to them


class DeviceNode(ComponentNode):
    """Hosts a `Device`."""

    component: Device
    # of the class, as a node that is refused is destroyed before it is whole
    _stop: Stop | None = None
    _thread: threading.Thread | None = None

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self._readings: SimpleQueue[Reading | Exception] = SimpleQueue()

    def _activate(self) -> None:
        super()._activate()
        self._stop, self._readings = Stop(), SimpleQueue()
        self._thread = threading.Thread(
            target=self._read, args=(self.component, self._stop, self._readings), name=f"{self.get_name()} device"
        )
        self._thread.daemon = True  # a system call that never returns must not hold the process
        self._thread.start()

    def _deactivate(self) -> None:
        self._end_thread()
        super()._deactivate()

    def _clean_up(self) -> None:
        self._end_thread()
        super()._clean_up()

    def destroy_node(self) -> None:
        """Destroys the node, after its thread has ended."""
        self._end_thread()
        super().destroy_node()

    def _end_thread(self) -> None:
        if self._stop is None or self._thread is None:
            return
        self._stop.now()
        self._thread.join(_PATIENCE)
        if self._thread.is_alive():
            self.counters["device_hangs"] += 1
            self.get_logger().error(f"the device has not let go for {_PATIENCE:g} s: its thread is left behind")
        self._stop = self._thread = None

    def _read(self, component: Device, stop: Stop, readings: SimpleQueue) -> None:
        """The thread; what a driver did not foresee costs a second, and it begins anew."""
        while not stop:
            try:
                for reading in component.readings(stop):
                    if stop:
                        return
                    self._hand_over(reading, readings)
            except Exception as error:
                self._hand_over(error, readings)
            stop.within(_AFTER_FAILURE)

    def _hand_over(self, reading: Reading | Exception, readings: SimpleQueue) -> None:
        if readings.qsize() >= _MOST_WAITING:
            self.counters["readings_dropped"] += 1
            return
        readings.put(reading)
        self._come()

    def _come(self) -> None:
        executor = self.executor
        if executor is not None:
            executor.create_task(self._take_readings)

    def _take_readings(self) -> None:
        while True:
            try:
                reading = self._readings.get_nowait()
            except Empty:
                return
            if isinstance(reading, Exception):
                self._report_failure(reading)
            elif self._is_active:
                self._run(reading.stamp_ns, {READING: reading})  # type: ignore[dict-item]
                self.component.published(reading)
