# SPDX-License-Identifier: Apache-2.0
"""All faults that sensors and actuators may have: names, values with units and bounds, by the sort of what fails.

A kind has one name whatever it befalls. A new one is an entry here, and what it does in `fault_effects`.
"""

import math

from css_common.fault_lines import FaultKind, FaultValue
from css_common.schema import real
from css_sim import fault_effects as effects

SORTS = {
    "cell": effects.CELL,
    "gyro": effects.GYRO,
    "magnetometer": effects.MAGNETOMETER,
    "wheel": effects.WHEEL,
    "rod": effects.ROD,
    "tachometer": effects.TACHOMETER,
    "head": effects.HEAD,
}
AXES = ("x", "y", "z")

_RPM = 2.0 * math.pi / 60.0
_UNITS = {  # of what a sort reads or is commanded: unit, factor to SI, largest value
    "cell": ("-", 1.0, 10.0),
    "gyro": ("deg/s", math.radians(1.0), 1e4),
    "magnetometer": ("nT", 1e-9, 1e6),
    "wheel": ("N m", 1.0, 100.0),
    "rod": ("A m^2", 1.0, 1e4),
    "tachometer": ("rpm", _RPM, 1e6),
}
_FACTOR = FaultValue(real("factor", 1.0, "-", "", low=-1e3, high=1e3))
_SHARE = FaultValue(real("share", 0.0, "-", "", low=0.0, high=1.0))
_DELAY = FaultValue(real("delay_us", 300.0, "us", "", low=1.0, high=1e6))
_SPELL = FaultValue(real("spell", 0.0, "s", "", low=0.0, open_low=True, high=1e6), cycles=-1)


def _amount(sort: str, name: str, low: float | None = None, per_second: bool = False) -> FaultValue:
    """A value in the unit of a sort; any sign unless a least value is given."""
    unit, factor, most = _UNITS[sort]
    shown = ("1/s" if unit == "-" else f"{unit}/s") if per_second else unit
    return FaultValue(real(name, 0.0, shown, "", low=-most if low is None else low, high=most), factor, int(per_second))


def _kind(sort: str, name: str) -> FaultKind:
    code, values, description = _COMMON[name](sort)
    return FaultKind(sort, name, code, values, description, whole=code == effects.SILENT)


_COMMON = {
    "dead": lambda s: (effects.DEAD, (), "gives nothing: zero"),
    "stuck": lambda s: (effects.STUCK, (_amount(s, "level"),), "gives this, whatever it should"),
    "frozen": lambda s: (effects.FROZEN, (), "stays at what it gave when the fault began"),
    "noisy": lambda s: (effects.NOISY, (_amount(s, "sigma", 0.0),), "normal noise of this deviation on top"),
    "drifting": lambda s: (effects.DRIFTING, (_amount(s, "rate", per_second=True),), "an error that grows"),
    "scaled": lambda s: (effects.SCALED, (_FACTOR,), "times this"),
    "bias": lambda s: (effects.BIAS, (_amount(s, "offset"),), "plus this: a step, or constant from time 0 on"),
    "sign": lambda s: (effects.SIGN, (), "with the wrong sign"),
    "saturated": lambda s: (effects.SATURATED, (_amount(s, "limit", 0.0),), "never larger than this"),
    "spikes": lambda s: (effects.SPIKES, (_amount(s, "size", 0.0), _SHARE), "off by this, either way, now and then"),
    "intermittent": lambda s: (effects.INTERMITTENT, (_SHARE, _SPELL), "nothing in a share of spells of this length"),
    "silent": lambda s: (effects.SILENT, (), "says that it has no reading"),
}  # fmt: skip

_CELL_KINDS = (
    FaultKind("cell", "stuck_low", effects.STUCK_LOW, (), "the lowest output of its converter"),
    FaultKind("cell", "stuck_high", effects.STUCK_HIGH, (), "the highest output of its converter"),
    FaultKind(
        "cell",
        "stuck_random",
        effects.STUCK_RANDOM,
        (_amount("cell", "lowest"), _amount("cell", "highest")),
        "stuck at an output drawn between these, for each case and cell",
    ),
    FaultKind("cell", "wrap", effects.WRAP, (), "a converter that reads what is negative as full scale"),
    FaultKind(
        "cell",
        "swapped",
        effects.SWAPPED,
        (FaultValue(real("other", 0.0, "-", "", low=0.0, high=31.0), names_unit=True),),
        "exchanged with the cell of this number",
    ),
    FaultKind("cell", "shadowed", effects.SHADOWED, (_SHARE,), "this share of all light is kept from it"),
)
_WHEEL_KINDS = (
    FaultKind("wheel", "dead", effects.DEAD, (), "its motor gives no torque"),
    FaultKind(
        "wheel",
        "friction",
        effects.FRICTION,
        (
            FaultValue(real("coulomb", 0.0, "N m", "", low=0.0, high=1.0)),
            FaultValue(real("viscous", 0.0, "N m s", "", low=0.0, high=1.0)),
        ),
        "this friction more, Coulomb and viscous",
    ),
    FaultKind(
        "wheel",
        "saturated",
        effects.SLOW,
        (FaultValue(real("limit", 0.0, "rpm", "", low=0.0, open_low=True, high=1e6), _RPM),),
        "turns no faster than this",
    ),
)
_HEAD_KINDS = (
    FaultKind("head", "dead", effects.DEAD, (), "gives no pulse"),
    FaultKind("head", "dropped", effects.DROPPED, (_SHARE,), "this share of its pulses never comes"),
    FaultKind("head", "doubled", effects.DOUBLED, (_SHARE, _DELAY), "this share of them comes again, so much later"),
    FaultKind("head", "late", effects.LATE, (_DELAY,), "its pulses come so much late"),
    FaultKind(
        "head",
        "spurious",
        effects.SPURIOUS,
        (FaultValue(real("rate", 0.0, "1/s", "", low=0.0, high=1000.0)),),
        "gives so many pulses besides, at any time and from any slit",
    ),
)
_READINGS = ("dead", "stuck", "frozen", "noisy", "drifting", "scaled", "bias", "sign", "spikes", "intermittent")
_BY_SORT = {
    "cell": (*_READINGS, "saturated"),
    "gyro": (*_READINGS, "saturated", "silent"),
    "magnetometer": (*_READINGS, "saturated", "silent"),
    "wheel": ("stuck", "scaled", "sign", "noisy", "intermittent"),
    "rod": ("dead", "stuck", "frozen", "scaled", "sign", "intermittent"),
    "tachometer": (*_READINGS, "saturated"),
}

KINDS: tuple[FaultKind, ...] = tuple(
    sorted(
        (
            *(_kind(sort, name) for sort, names in _BY_SORT.items() for name in names),
            *_CELL_KINDS,
            *_WHEEL_KINDS,
            *_HEAD_KINDS,
        ),
        key=lambda kind: SORTS[kind.sort],
    )
)


def kinds_of(*sorts: str) -> tuple[FaultKind, ...]:
    """All kinds of faults of some sorts of units."""
    return tuple(kind for kind in KINDS if kind.sort in sorts)
