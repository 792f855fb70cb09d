# SPDX-License-Identifier: Apache-2.0
"""The measured magnetic field as a control law has it: the last one, for as long as the next may be on its way."""

from typing import NamedTuple

from css_common.vectors import Vec3


class HeldField(NamedTuple):
    """What is known of the field in one cycle."""

    field_b: Vec3  # [T] last measurement
    valid: bool  # it is no older than the time between two measurements
    fresh: bool  # it was measured in this very cycle


NO_FIELD_MEASURED = HeldField((0.0, 0.0, 0.0), False, False)
"""Nothing measured yet."""
