# SPDX-License-Identifier: Apache-2.0
"""Topics of a flight by the types of their messages, for all that looks at a flight, recorded or live."""

from css_common.codec import type_name
from css_msgs.msg import (
    AttitudeEstimate,
    ControlStatus,
    CssVoltages,
    Faults,
    Health,
    RodDipoleCommand,
    SpacecraftState,
    SunEstimate,
    WheelState,
    WheelTorqueCommand,
)

ESTIMATES = {SunEstimate: ("estimates", "/sun_estimate"), AttitudeEstimate: ("attitudes", "/attitude")}
"""Messages of estimators, of which a flight may have several: attribute of the log and end of the topic."""

SINGLE = {
    "truth": (SpacecraftState, "/truth"),
    "voltages": (CssVoltages, "/css/voltages"),
    "wheels": (WheelState, "/wheels/state"),
    "torque_command": (WheelTorqueCommand, "/wheels/torque_command"),
    "rod_command": (RodDipoleCommand, "/rods/dipole_command"),
    "control": (ControlStatus, "/control/status"),
}
"""Topics that a flight has once: attribute of the log, type, name in Sunpoint's own graphs."""

TRUE_WHEELS = "/truth/wheels"
"""Beside the reported wheels, where tachometers err."""

TOLD_TYPES: tuple[type, ...] = (Faults, Health)
"""Messages about units that fail, sent when something changes: each holds until the next."""

LOGGED_TYPES: dict[str, type] = {type_name(kind): kind for kind in (*ESTIMATES, *(kind for kind, _ in SINGLE.values()))}
"""Messages that a log holds, type name to class."""


def estimator_of(topic: str) -> str:
    """Name of the estimator that publishes a topic: `/ekf/sun_estimate` is of `ekf`."""
    for _, suffix in ESTIMATES.values():
        if topic.endswith(suffix):
            return topic.removesuffix(suffix).strip("/") or suffix.strip("/")
    return topic.strip("/")
