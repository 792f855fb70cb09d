# SPDX-License-Identifier: Apache-2.0
"""A plant that counts: its voltages tell the step."""

import numpy as np

from css_common.component import INERTIAL, Input, Outgoing, Output, Plant, Received
from css_common.schema import Values, integer, reals
from css_msgs.msg import CssVoltages, SpacecraftState, WheelTorqueCommand


class Source(Plant):
    """Publishes the step number and remembers the commands that came for it."""

    parameters = (
        integer("fails_at", -1, "-", "step in which the plant fails; -1: none", low=-1),
        reals("offsets", (0.0, 0.0), "-", "added to the step in each cell", length=2),
    )

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """The command."""
        return (Input("command", "command", WheelTorqueCommand, required=False),)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """Voltages and the truth."""
        return (
            Output("voltages", "voltages", CssVoltages),
            Output("truth", "truth", SpacecraftState, frame=INERTIAL),
        )

    def configure(self) -> None:
        """Starts at step 0."""
        self.step = 0
        self.last = round(self.values.mission.duration / self.values.mission.period)
        self.commands: list[float | None] = []

    def begin(self) -> Outgoing:
        """Step 0."""
        return self._messages(self.epoch_ns)

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """The next step."""
        if self.step == self.values.fails_at:
            raise RuntimeError("the plant is out of order")
        command = received["command"]
        self.commands.append(None if command is None else float(command.torque[0]))
        self.step += 1
        self.finished = self.step == self.last
        return self._messages(stamp_ns + self.period_ns)

    def _messages(self, stamp_ns: int) -> Outgoing:
        zeros = np.zeros(3)
        return {
            "voltages": self.message(
                "voltages", stamp_ns, saturated=0, voltages=self.values.offsets + float(self.step)
            ),
            "truth": self.message(
                "truth", stamp_ns, r_n=zeros, v_n=zeros, sigma_bn=zeros, omega_bn_b=zeros, sun_n=zeros,
                field_n=zeros, solar_flux=1.0, illumination=1.0,
            ),
        }  # fmt: skip
