# SPDX-License-Identifier: Apache-2.0
"""Sun heading by an unscented filter on the Sun vector and its rate."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import sunline_ukf
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class SunlineUkf(SunEstimator):
    """Sun heading by an unscented filter on the Sun vector and its rate."""

    algorithm: ClassVar[SunAlgorithm] = sunline_ukf
    parameters = sunline_ukf.PARAMETERS


main = node_main(SunlineUkf)
