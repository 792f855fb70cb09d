# SPDX-License-Identifier: Apache-2.0
"""Cells on a converter."""

import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator

import numpy as np

from css_common.codec import Sample
from css_common.component import Outgoing, Output, Received, Standing
from css_common.device import READING, Device, Reading, Stop
from css_common.link import GAP
from css_common.run import node_main
from css_common.schema import Values
from css_drivers import converter_options
from css_drivers.cell_source import CellSource, Scan
from css_drivers.converter_options import RETRY, STUCK_SCANS, calibration, cell_source, scan_period
from css_drivers.device_errors import GONE, KINDS, DeviceError
from css_drivers.latency_record import LatencyRecord
from css_msgs.msg import CssVoltages

_FAILURES_IN_A_ROW = 3  # after which a chip is set up anew, even if its bus is there
_LIT = 0.05  # above which a cell is lit, so that its output moves with the body and its noise


class CssAdc(Device):
    """Outputs of real cells from an ADS1115, ADC128D818, MCP3208 or a serial line, in the place of `css_array`."""

    shared = ("cells",)
    parameters = converter_options.PARAMETERS

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        return (Output("voltages", "css/voltages", CssVoltages, may_lack=("voltages",)),)

    @classmethod
    def needed(cls, values: Values) -> tuple[str, ...]:
        return ("cells.normals",)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        return converter_options.conflicts(values)

    def configure(self) -> None:
        self._dark, self._full_scale = calibration(self.values)
        self._source: CellSource = cell_source(self.values)
        self._counts: Counter[str] = Counter()
        self._latency, self._scan_time = LatencyRecord(), LatencyRecord()
        self._trouble = ""
        self._trouble_since = 0.0
        self._unchanged = 0
        self._before: tuple[float, ...] = ()

    # In the thread of the device

    def readings(self, stop: Stop) -> Iterator[Reading]:
        """A scan each, or None as the value where there is none."""
        period = scan_period(self.values)
        source, is_open, failures = self._source, False, 0
        due = time.monotonic()
        try:
            while not stop:
                try:
                    if not is_open:
                        source.open()
                        is_open = True
                    scan = source.scan(stop)
                except DeviceError as error:
                    if stop:
                        return
                    failures += 1
                    self._note_trouble(error)
                    yield Reading(time.time_ns(), time.monotonic_ns(), None)
                    if not is_open or error.kind == GONE or failures % _FAILURES_IN_A_ROW == 0:
                        source.close()
                        is_open = False
                        stop.within(self.values[RETRY])
                        due = time.monotonic()
                else:
                    failures = 0
                    self._note_recovery()
                    yield Reading(scan.stamp_ns, scan.taken_ns, scan)
                if not source.paces or not is_open:
                    due = self._wait_for_next(due, period, stop)
        finally:
            source.close()

    def _wait_for_next(self, due: float, period: float, stop: Stop) -> float:
        """Waits until the next scan is due; when it is."""
        due += period
        late = time.monotonic() - due
        if late > 0.0:
            missed = math.ceil(late / period)
            self._counts["scans_missed"] += missed
            due += missed * period
        stop.within(due - time.monotonic())
        return due

    def _note_trouble(self, error: DeviceError) -> None:
        self._counts[f"errors_{error.kind}"] += 1
        if not self._trouble:
            self._trouble_since = time.monotonic()
        if str(error) != self._trouble:
            self.report(f"{error} (further ones are counted, not reported)")
        self._trouble = str(error)

    def _note_recovery(self) -> None:
        self._counts["reads"] += 1
        if self._trouble:
            self.report(f"reads again after {time.monotonic() - self._trouble_since:.1f} s without: {self._trouble}")
            self._counts["recoveries"] += 1
        self._trouble = ""

    # In the thread of the node

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        scan: Scan | None = received[READING].value
        if scan is None or all(value != value for value in scan.values):
            self._counts["gaps"] += 1
            return {"voltages": self._gap(stamp_ns)}
        self._look_for_stuck(scan)
        self._scan_time.note(scan.took_ns)
        voltages = (np.array(scan.values) - self._dark) / self._full_scale
        return {"voltages": self.message("voltages", stamp_ns, saturated=scan.at_limit, voltages=voltages)}

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        return {}

    def published(self, reading: Reading) -> None:
        if reading.value is not None:
            self._latency.note(self.age_ns(reading))

    def _gap(self, stamp_ns: int) -> Sample:
        message = self.message("voltages", stamp_ns, saturated=0, voltages=np.zeros(len(self._dark)))
        message.frame_id = GAP
        return message

    def _look_for_stuck(self, scan: Scan) -> None:
        same = scan.values == self._before
        lit = np.any((np.array(scan.values) - self._dark) / self._full_scale > _LIT)
        self._unchanged = self._unchanged + 1 if same and lit else 0
        self._before = scan.values

    def standing(self) -> Standing:
        """Counts, latencies, and what is wrong with the device now."""
        counts = {"reads": 0, "gaps": 0, "recoveries": 0, **{f"errors_{kind}": 0 for kind in KINDS}}
        counts |= {**self._counts, **{key: n for key, n in self._source.counts.items() if n}}
        figures = {**counts, **self._latency.figures("latency"), **self._scan_time.figures("scan")}
        if self._trouble:
            lasted = time.monotonic() - self._trouble_since
            return Standing(f"no reading for {lasted:.1f} s: {self._trouble}", True, figures)
        if 0 < self.values[STUCK_SCANS] <= self._unchanged:
            return Standing(f"no cell has changed in {self._unchanged} scans: the converter is stuck", False, figures)
        bad = sum(n for key, n in self._source.counts.items() if key.startswith("lines_"))
        if bad:
            return Standing(f"{bad} lines bad, lost or left out", False, figures)
        return Standing(figures=figures)


main = node_main(CssAdc)
