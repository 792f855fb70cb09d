# SPDX-License-Identifier: Apache-2.0
"""An estimator with every fault that a component may have, on demand."""

from collections.abc import Iterable
from typing import ClassVar, cast

import numpy as np
from sensor_msgs.msg import Imu, MagneticField

from css_common.codec import codec_of
from css_common.component import Component, Input, Outgoing, Output, Received
from css_common.schema import ParameterError, Table, Values, choice, flag, integer, real, reals, text, texts
from css_msgs.msg import CssVoltages, SunEstimate
from testbed.nodes.compass import DIVIDER

FAULTS = ("none", "raise", "nan", "nothing", "unknown_output", "missing_field", "wrong_length", "configure", "refuse")


class Estimator(Component):
    """Puts gain times the first voltage into the age of its estimate, and the number of its cycles into nis."""

    shared = ("cells",)
    parameters: ClassVar[Table] = (
        real("gain", 1.0, "-", "factor of the voltage", low=0.0, high=10.0, tunable=True),
        real("floor", 0.0, "V", "least voltage", tunable=True),
        real("width_deg", 30.0, "deg", "never used", low=0.0, high=90.0, open_low=True),
        integer("window", 4, "-", "never used", low=1, high=100),
        integer("offset", 0, "-", "never used"),
        flag("use_gyro", True, "listen to the gyro"),
        flag("use_field", False, "listen to the magnetometer"),
        flag("loud", False, "never used", tunable=True),
        choice("fault", "none", FAULTS, "what goes wrong", tunable=True),
        text("note", "", "never used"),
        reals("weights", (1.0, 2.0), "-", "never used", length=2, low=0.0, tunable=True),
        reals("rows", (1.0, 2.0, 3.0), "-", "never used", columns=3),
        texts("labels", (), "never used"),
    )

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """Voltages, and what it is told to listen to."""
        inputs = [Input("voltages", "voltages", CssVoltages, lengths={"voltages": 2})]
        if values.use_gyro:
            inputs.append(Input("gyro", "gyro/imu", Imu, required=False, used=("angular_velocity",), switch="use_gyro"))
        if values.use_field:
            inputs.append(
                Input("field", "mag/field", MagneticField, required=False, divider=DIVIDER, used=("magnetic_field",))
            )
        return tuple(inputs)

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """The estimate."""
        return (Output("estimate", f"{name}/sun_estimate", SunEstimate, ends_cycle=True),)

    @classmethod
    def conflicts(cls, values: Values) -> Iterable[str]:
        """The gain may not pass the floor."""
        if values.floor > values.gain:
            yield f"floor: {values.floor} given, expected at most the gain of {values.gain}"

    def configure(self) -> None:
        """Counts from zero."""
        if self.values.fault == "configure":
            raise RuntimeError("no such table")
        if self.values.fault == "refuse":
            raise ParameterError("fault: refused on demand")
        self.count = 0
        self.cycles: list[tuple[int, dict]] = []

    def cycle(self, stamp_ns: int, received: Received) -> Outgoing:
        """One estimate."""
        fault = self.values.fault
        if fault == "raise":
            raise ZeroDivisionError("on demand")
        if fault == "nothing":
            return cast(Outgoing, None)
        self.count += 1
        self.cycles.append((stamp_ns, dict(received)))
        estimate = codec_of(SunEstimate).sample(stamp_ns, self.frames["estimate"])
        estimate.age = self.values.gain * float(received["voltages"].voltages[0])
        estimate.nis = float(self.count)
        estimate.nis_dof = sum(sample is not None for sample in received.values())
        if fault == "nan":
            estimate.sun_b = np.array([0.0, np.nan, 0.0])
        elif fault == "missing_field":
            del estimate.age
        elif fault == "wrong_length":
            estimate.sun_b = np.zeros(4)
        return {"guess" if fault == "unknown_output" else "estimate": estimate}
