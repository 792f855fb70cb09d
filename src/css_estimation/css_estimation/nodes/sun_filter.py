# SPDX-License-Identifier: Apache-2.0
"""Sun heading of any layout of cells, with the Earth's light predicted where the place in orbit is known."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator
from css_estimation.sun_filter import sun_filter


class SunFilter(SunEstimator):
    """Sun heading by one filter of attitude, rate, intensity and Earth, with gyro, wheels or neither."""

    algorithm: ClassVar[SunAlgorithm] = sun_filter
    shared = (*SunEstimator.shared, "spacecraft", "wheels")
    parameters = sun_filter.PARAMETERS


main = node_main(SunFilter)

if __name__ == "__main__":
    raise SystemExit(main())
