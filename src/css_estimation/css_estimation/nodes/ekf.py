# SPDX-License-Identifier: Apache-2.0
"""Kalman-filtered Sun heading."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import sunline_ekf
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class Ekf(SunEstimator):
    """Sun heading by an extended Kalman filter that turns with the body rate (O'Keefe & Schaub 2013)."""

    algorithm: ClassVar[SunAlgorithm] = sunline_ekf
    parameters = sunline_ekf.PARAMETERS


main = node_main(Ekf)
