# SPDX-License-Identifier: Apache-2.0
"""Safe-hold Sun heading from a collared pyramid of cells, or flat ones where it does not see the Sun."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import pyramid_switch
from css_estimation.sun.safe_hold import MODE_NAMES
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class PyramidSwitch(SunEstimator):
    """Sun heading from a collared pyramid once flat cells have found the Sun (Benton)."""

    shared = (*SunEstimator.shared, "spacecraft")
    algorithm: ClassVar[SunAlgorithm] = pyramid_switch
    parameters = pyramid_switch.PARAMETERS
    mode_names = MODE_NAMES


main = node_main(PyramidSwitch)
