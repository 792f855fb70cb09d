# SPDX-License-Identifier: Apache-2.0
"""Weighted-average Sun heading."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import wavg
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class Wavg(SunEstimator):
    """Sun heading as the average of the lit cells' normals, weighted by their outputs (O'Keefe & Schaub 2013)."""

    algorithm: ClassVar[SunAlgorithm] = wavg
    parameters = wavg.PARAMETERS


main = node_main(Wavg)
