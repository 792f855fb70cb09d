# SPDX-License-Identifier: Apache-2.0
"""The quantities of faults: when they showed, what was held for failed, what was wrong of that."""

from collections.abc import Callable

import numpy as np

from css_analysis import fault_sums
from css_analysis.fault_sums import CELLS, RODS, SENSORS, WHEELS
from css_analysis.quantity import CaseSums, Quantity


def _isolated(name: str, description: str, *sorts: int) -> Quantity:
    return _counted(name, description, lambda sums: fault_sums.isolated_units(sums.health, *sorts))


def _wrong(name: str, description: str, *sorts: int) -> Quantity:
    return _counted(name, description, lambda sums: fault_sums.false_isolations(sums.health, *sorts))


def _counted(name: str, description: str, count: Callable[[CaseSums], np.ndarray]) -> Quantity:
    return Quantity(name, "", description, tally=count, whole=True)


FAULTS = (
    Quantity(
        "fault_shown_s",
        "s",
        "time since the epoch at which the first fault shows: that of a cell when its reading is off by more than "
        "5 sigma of its noise, losses, calibration and 0.4 of the light of the Earth on it; that of other units when "
        "it begins",
        tally=lambda sums: fault_sums.shown_s(sums.health, sums.period_s),
    ),
    Quantity(
        "detected_s",
        "s",
        "longest time from a fault that shows to the isolation of its unit; null while one of them is not isolated",
        tally=lambda sums: fault_sums.detected_s(sums.health, sums.period_s),
    ),
    Quantity(
        "undetected_units",
        "",
        "units whose fault showed and that were not isolated while it acted",
        tally=lambda sums: fault_sums.undetected_units(sums.health),
        whole=True,
    ),
    _counted(
        "misnamed_units",
        "failed cells that were isolated and last taken for what they are not; kinds that no reading tells apart are "
        "one",
        lambda sums: fault_sums.misnamed_units(sums.health),
    ),
    _isolated("isolated_cells", "different cells that were ever isolated", CELLS),
    _isolated("isolated_actuators", "different wheels and torque rods that were ever isolated", WHEELS, RODS),
    _isolated(
        "left_sensors",
        "gyro and magnetometer: of how many of them axes were ever held for failed, whether they were left out or "
        "corrected",
        SENSORS,
    ),
    _wrong("false_isolations", "isolations of a cell that began while no fault acted on it", CELLS),
    _wrong(
        "false_actuator_isolations",
        "isolations of a wheel or torque rod that began while no fault acted on it",
        WHEELS,
        RODS,
    ),
    _wrong(
        "falsely_left_sensors",
        "gyro and magnetometer: how often an axis was held for failed while no fault acted on it",
        SENSORS,
    ),
)
