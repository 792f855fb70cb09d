# SPDX-License-Identifier: Apache-2.0
"""A component that gets its topics wrong."""

from sensor_msgs.msg import MagneticField

from css_common.component import Component, Input, Output
from css_common.schema import Values, choice
from css_msgs.msg import CssVoltages, WheelTorqueCommand


class Rival(Component):
    """Wired as the parameter says."""

    parameters = (
        choice("wiring", "publisher", ("publisher", "type", "divider", "nowhere"), "how it is wired wrongly"),
    )

    @classmethod
    def inputs(cls, name: str, values: Values) -> tuple[Input, ...]:
        """Something that cannot work."""
        return {
            "publisher": (),
            "type": (Input("voltages", "voltages", WheelTorqueCommand),),
            "divider": (Input("field", "mag/field", MagneticField),),
            "nowhere": (Input("voltages", "voltagse", CssVoltages),),
        }[values.wiring]

    @classmethod
    def outputs(cls, name: str, values: Values) -> tuple[Output, ...]:
        """A topic that somebody else publishes."""
        return (Output("voltages", "voltages", CssVoltages),) if values.wiring == "publisher" else ()
