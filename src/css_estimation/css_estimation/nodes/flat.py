# SPDX-License-Identifier: Apache-2.0
"""Safe-hold Sun heading from flat cells."""

from typing import ClassVar

from css_common.run import node_main
from css_estimation.sun import flat_cells
from css_estimation.sun.safe_hold import MODE_NAMES
from css_estimation.sun.sun_algorithm import SunAlgorithm
from css_estimation.sun.sun_estimator import SunEstimator


class Flat(SunEstimator):
    """Sun heading from the brighter of each pair of opposite faces (Benton)."""

    algorithm: ClassVar[SunAlgorithm] = flat_cells
    parameters = flat_cells.PARAMETERS
    mode_names = MODE_NAMES


main = node_main(Flat)
