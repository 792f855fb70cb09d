# SPDX-License-Identifier: Apache-2.0
"""A slow sensor."""

import numpy as np
from sensor_msgs.msg import MagneticField

from css_common.component import INERTIAL, Component, Input, Outgoing, Output, Received
from css_common.schema import Values
from css_msgs.msg import SpacecraftState

DIVIDER = 4


class Compass(Component):
    """Speaks in every fourth step only."""

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """The truth."""
        return (Input("truth", "truth", SpacecraftState, frame=INERTIAL),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """The field."""
        return (Output("field", "mag/field", MagneticField, divider=DIVIDER),)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """A field when it is due."""
        if self.step_of(stamp_ns) % DIVIDER:
            return {}
        return {
            "field": self.message("field", stamp_ns, magnetic_field=np.ones(3), magnetic_field_covariance=np.zeros(9))
        }
