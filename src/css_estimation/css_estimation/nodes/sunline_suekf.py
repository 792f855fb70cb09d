# SPDX-License-Identifier: Apache-2.0
"""Sun heading by an unscented filter on direction, rates across it and light, whose frame switches."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import sunline_suekf
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class SunlineSuekf(SunEstimator):
    """Sun heading by a switch filter on direction, the rates across it and the light (Teil, Schaub & Piggott)."""

    algorithm: ClassVar[SunAlgorithm] = sunline_suekf
    parameters = sunline_suekf.PARAMETERS


main = node_main(SunlineSuekf)
