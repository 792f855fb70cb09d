# SPDX-License-Identifier: Apache-2.0
"""Faults of sensors of three axes: gyro and magnetometer."""

from css_common.case_faults import CaseFault, CaseFaults
from css_common.fault_lines import FAULTS, Units
from css_common.mission_section import PERIOD
from css_common.random_streams import RandomKey
from css_common.schema import Values
from css_sim import faults
from css_sim.fault_kinds import AXES, kinds_of

GYRO_KINDS = kinds_of("gyro")
MAGNETOMETER_KINDS = kinds_of("magnetometer")


def units(sort: str) -> Units:
    """The axes that may fail."""
    return {sort: AXES}


def of_case(values: Values, sort: str, key: RandomKey) -> CaseFaults:
    """The faults of one case of a `gyro` or a `magnetometer`, by the lines that there are."""
    return faults.of_case(kinds_of(sort), units(sort), key, values[PERIOD])


def case_faults(values: Values, sort: str, key: RandomKey) -> list[CaseFault]:
    """Faults of one case of a `gyro` or a `magnetometer`."""
    return of_case(values, sort, key).of(values[FAULTS])
