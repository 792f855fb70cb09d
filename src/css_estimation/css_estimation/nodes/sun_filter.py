# SPDX-License-Identifier: Apache-2.0
"""Sun heading of any layout of cells, with the Earth's light predicted where the place in orbit is known."""

from typing import ClassVar

from css_common.codec import Sample
from css_common.component import Outgoing, Received
from css_common.run import node_main
from css_estimation.health import watched
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator
from css_estimation.sun_filter import filter_state, sun_filter
from css_estimation.sun_filter.calibration_report import Calibrated, calibration_line, calibration_report


class SunFilter(SunEstimator):
    """Sun heading by one filter of attitude, rate, intensity and Earth, with gyro, wheels or neither."""

    algorithm: ClassVar[SunAlgorithm] = sun_filter
    shared = (*SunEstimator.shared, "spacecraft", "wheels")
    parameters = sun_filter.PARAMETERS

    def configure(self) -> None:
        super().configure()
        self._mode = filter_state.MODE_WAITING

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        outgoing = super().cycle(stamp_ns, received)
        estimate = outgoing["estimate"]
        assert isinstance(estimate, Sample)  # no output of events
        before, self._mode = self._mode, estimate.mode
        if before == filter_state.MODE_EARTH and self._mode == sun_filter.MODE_COASTING:
            report = self.calibration()
            if report:
                self.report(calibration_line(report))
        return outgoing

    def calibration(self) -> list[Calibrated]:
        """What the flight has told of the cells so far; empty where they are not calibrated in flight."""
        p, memory = watched.own_of(self._parameters, self._memory)
        return calibration_report(p, memory)


main = node_main(SunFilter)
