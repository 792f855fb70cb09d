# SPDX-License-Identifier: Apache-2.0
"""A controller that commands what it is told."""

import numpy as np

from css_common.component import Component, Input, Outgoing, Output, Received
from css_common.schema import Values
from css_msgs.msg import SunEstimate, WheelTorqueCommand


class Controller(Component):
    """Commands the age of the estimate."""

    shared = ("graph",)

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """The estimate that flies."""
        return (Input("estimate", f"{values.graph.estimator}/sun_estimate", SunEstimate),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """The command."""
        return (Output("command", "command", WheelTorqueCommand, ends_cycle=True),)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """One command."""
        return self._command(stamp_ns, received["estimate"].age)

    def idle(self, stamp_ns: int, received: Received) -> Outgoing:
        """Zero torque."""
        return self._command(stamp_ns, 0.0)

    def _command(self, stamp_ns: int, torque: float) -> Outgoing:
        return {"command": self.message("command", stamp_ns, saturated=0, torque=np.array([torque]))}
