# SPDX-License-Identifier: Apache-2.0
"""Least-squares Sun heading."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import least_squares
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class Wls(SunEstimator):
    """Sun heading by weighted least squares, of least norm where the lit cells do not span space."""

    algorithm: ClassVar[SunAlgorithm] = least_squares
    parameters = least_squares.PARAMETERS


main = node_main(Wls)
