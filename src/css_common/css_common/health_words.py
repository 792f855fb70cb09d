# SPDX-License-Identifier: Apache-2.0
"""Words for units that fail, for how they do and for what shows it: those of css_msgs/Faults and css_msgs/Health."""

from css_msgs.msg import Faults, Health

_AXES = "xyz"
_AXES_OF = (Faults.SORT_GYRO, Faults.SORT_MAGNETOMETER)


def _names(message: type, prefix: str) -> dict[int, str]:
    constants = (name for name in dir(type(message)) if name.startswith(prefix))
    return {getattr(message, name): name.removeprefix(prefix).lower().replace("_", " ") for name in constants}


_SORTS = _names(Faults, "SORT_")
KIND_WORDS = {**_names(Faults, "KIND_"), Health.KIND_UNKNOWN: "wrong in a way that has no name"}
EVIDENCE_WORDS = {
    Health.EVIDENCE_RANGE: "it reads what none can",
    Health.EVIDENCE_STUCK: "it reads the same while it should have changed",
    Health.EVIDENCE_DEAD: "it gives nothing where much was predicted",
    Health.EVIDENCE_NOISE: "from sample to sample it changes more than it can",
    Health.EVIDENCE_OPPOSITE: "it is lit together with the opposite one",
    Health.EVIDENCE_VOTE: "those that look the same way say otherwise",
    Health.EVIDENCE_RESIDUAL: "all others together say otherwise",
    Health.EVIDENCE_DRIFT: "small contradictions of one sign add up",
    Health.EVIDENCE_DARK: "it reads light in the shadow of the Earth",
    Health.EVIDENCE_COMMON: "it went dark together with all others that should see the Sun",
    Health.EVIDENCE_SUN: "the motion of the Sun says otherwise",
    Health.EVIDENCE_FIELD: "the magnetic field says otherwise",
    Health.EVIDENCE_MOMENTUM: "the speeds of the wheels say otherwise",
    Health.EVIDENCE_RESPONSE: "it does not what it is commanded",
}

DONE_WORDS = {
    Faults.SORT_WHEEL: "commanded nothing, the others do its part",
    Faults.SORT_ROD: "commanded nothing, the others do its part",
}
"""What is done about a unit that is held for failed; of sensors, that they are left out."""
LEFT_OUT = "left out"


def unit_name(sort: int, unit: int) -> str:
    """A unit as missions name it, such as `cell.3` or `gyro.x`."""
    return f"{_SORTS.get(sort, sort)}.{_AXES[unit] if sort in _AXES_OF and unit < len(_AXES) else unit}"
