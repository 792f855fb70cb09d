# SPDX-License-Identifier: Apache-2.0
"""The faults that fly: one for each line of the page, of a unit that is drawn for each case, at a time that is."""

from collections.abc import Iterator, Mapping
from itertools import combinations_with_replacement
from typing import NamedTuple

CELL, BOARD, PAIR, WHEEL, ROD, GYRO, MAGNETOMETER = "cell", "board", "pair", "wheel", "rod", "gyro", "magnetometer"


class Entry(NamedTuple):
    """One entry of a mission's section `faults`."""

    target: str
    kind: str
    values: tuple[tuple[str, str], ...] = ()


class Fault(NamedTuple):
    """What fails in all cases of one line."""

    label: str
    sort: str  # CELL, BOARD, ...
    entries: tuple[Entry, ...]
    prompt: bool = False  # has to be found within seconds
    quick: bool = False  # flown in a first look too

    def overrides(self, within_s: float) -> tuple[str, ...]:
        """Changes of a mission that make it fail, from a time in the first `within_s` on."""
        lines: list[str] = []
        for number, entry in enumerate(self.entries):
            key = f"faults.fault_{number}"
            lines += [f"{key}.target={entry.target}", f"{key}.kind={entry.kind}", f"{key}.within={within_s:g}"]
            lines += [f"{key}.{name}={value}" for name, value in entry.values]
        return tuple(lines)


NONE = Fault("no fault", "", (), quick=True)

_CELL_KINDS: tuple[tuple[str, str, Mapping[str, str]], ...] = (
    ("dead", "dead", {}),
    ("stuck at 0.5", "stuck", {"level": "0.5"}),
    ("stuck at 1.5", "stuck", {"level": "1.5"}),
    ("noisy, 0.3", "noisy", {"sigma": "0.3"}),
    ("drifting by 0.005/s", "drifting", {"rate": "0.005"}),
    ("scaled by 0.5", "scaled", {"factor": "0.5"}),
    ("shadowed by 0.7", "shadowed", {"share": "0.7"}),
    ("swapped with cell 1", "swapped", {"other": "1"}),
    ("saturated at 0.4", "saturated", {"limit": "0.4"}),
    ("wrapped", "wrap", {}),
    ("intermittent, half of 2 s", "intermittent", {"share": "0.5", "spell": "2"}),
    ("spikes of 0.5 in 0.1", "spikes", {"size": "0.5", "share": "0.1"}),
    ("wrong sign", "sign", {}),
    ("frozen", "frozen", {}),
    ("off by 0.3", "bias", {"offset": "0.3"}),
    ("stuck low", "stuck_low", {}),
    ("stuck high", "stuck_high", {}),
)
_PROMPT = ("dead", "stuck", "wrap")
_PAIRED = ("dead", "stuck at 0.5", "stuck at 1.5", "noisy, 0.3", "scaled by 0.5")
_WHEEL_KINDS: tuple[tuple[str, str, str, Mapping[str, str]], ...] = (
    ("wheel", "dead", "dead", {}),
    ("wheel", "with friction", "friction", {"coulomb": "0.003", "viscous": "1e-5"}),
    ("wheel", "scaled by 0.5", "scaled", {"factor": "0.5"}),
    ("wheel", "stuck at 0.01 N m", "stuck", {"level": "0.01"}),
    ("wheel", "wrong sign", "sign", {}),
    ("wheel", "noisy, 0.01 N m", "noisy", {"sigma": "0.01"}),
    ("wheel", "intermittent, half of 2 s", "intermittent", {"share": "0.5", "spell": "2"}),
    ("wheel", "no faster than 30 rpm", "saturated", {"limit": "30"}),
    ("tachometer", "dead", "dead", {}),
    ("tachometer", "frozen", "frozen", {}),
    ("tachometer", "off by 200 rpm", "bias", {"offset": "200"}),
    ("tachometer", "wrong sign", "sign", {}),
)
_ROD_KINDS: tuple[tuple[str, str, Mapping[str, str]], ...] = (
    ("dead", "dead", {}),
    ("frozen", "frozen", {}),
    ("wrong sign", "sign", {}),
    ("scaled by 0.5", "scaled", {"factor": "0.5"}),
    ("intermittent, half of 2 s", "intermittent", {"share": "0.5", "spell": "2"}),
)
_GYRO_KINDS: tuple[tuple[str, str, Mapping[str, str]], ...] = (
    ("off by 1 deg/s", "bias", {"offset": "1"}),
    ("off by 5 deg/s", "bias", {"offset": "5"}),
    ("dead", "dead", {}),
    ("stuck at 0.5 deg/s", "stuck", {"level": "0.5"}),
    ("frozen", "frozen", {}),
    ("wrong sign", "sign", {}),
    ("scaled by 0.5", "scaled", {"factor": "0.5"}),
    ("drifting by 0.01 deg/s^2", "drifting", {"rate": "0.01"}),
    ("noisy, 1 deg/s", "noisy", {"sigma": "1"}),
    ("spikes of 3 deg/s in 0.1", "spikes", {"size": "3", "share": "0.1"}),
    ("intermittent, half of 2 s", "intermittent", {"share": "0.5", "spell": "2"}),
)
_FIELD_KINDS: tuple[tuple[str, str, Mapping[str, str]], ...] = (
    ("off by 10 uT", "bias", {"offset": "10000"}),
    ("dead", "dead", {}),
    ("stuck at 20 uT", "stuck", {"level": "20000"}),
    ("frozen", "frozen", {}),
    ("wrong sign", "sign", {}),
    ("noisy, 5 uT", "noisy", {"sigma": "5000"}),
    ("spikes of 20 uT in 0.1", "spikes", {"size": "20000", "share": "0.1"}),
    ("drifting by 10 nT/s", "drifting", {"rate": "10"}),
)
_QUICK = ("dead", "stuck at 1.5", "dead and dead", "off by 1 deg/s")


def _entry(target: str, kind: str, values: Mapping[str, str]) -> Entry:
    return Entry(target, kind, tuple(values.items()))


def _fault(sort: str, label: str, *entries: Entry, prompt: bool = False) -> Fault:
    return Fault(f"{sort} {label}", sort, entries, prompt, label in _QUICK)


def cell_faults() -> Iterator[Fault]:
    """Of one cell, whichever it is."""
    for label, kind, values in _CELL_KINDS:
        yield _fault(CELL, label, _entry("cell.any", kind, values), prompt=kind in _PROMPT)


def board_fault(cells: str) -> Fault:
    """All cells of a board, given as the range of a target."""
    return _fault(BOARD, f"of cells {cells} dead", Entry(f"cell.{cells}", "dead"))


def pairs() -> Iterator[Fault]:
    """Two cells, each of which is drawn; cases that draw the same twice are left out where they are measured."""
    known = {label: (kind, values) for label, kind, values in _CELL_KINDS}
    for one, two in combinations_with_replacement(_PAIRED, 2):
        yield _fault(PAIR, f"{one} and {two}", *(_entry("cell.any", *known[label]) for label in (one, two)))


def wheel_faults() -> Iterator[Fault]:
    """Of one wheel or what measures its speed."""
    for sort, label, kind, values in _WHEEL_KINDS:
        yield Fault(
            f"{sort} {label}", WHEEL, (_entry(f"{sort}.any", kind, values),), quick=(sort, label) == _QUICK_WHEEL
        )


_QUICK_WHEEL = ("wheel", "dead")


def rod_faults(level: float) -> Iterator[Fault]:
    """Of one torque rod, that may be stuck at a dipole [A m^2]."""
    yield _fault(ROD, f"stuck at {level:g} A m^2", _entry("rod.any", "stuck", {"level": f"{level:g}"}))
    for label, kind, values in _ROD_KINDS:
        yield _fault(ROD, label, _entry("rod.any", kind, values))


def gyro_faults() -> Iterator[Fault]:
    """Of one axis of the gyro, and of all."""
    for label, kind, values in _GYRO_KINDS:
        yield _fault(GYRO, label, _entry("gyro.any", kind, values))
    yield _fault(GYRO, "off by 5 deg/s, all axes", Entry("gyro.all", "bias", (("offset", "5"),)))
    yield _fault(GYRO, "silent", Entry("gyro.all", "silent"))


def magnetometer_faults() -> Iterator[Fault]:
    """Of one axis of the magnetometer, and of all."""
    for label, kind, values in _FIELD_KINDS:
        yield _fault(MAGNETOMETER, label, _entry("magnetometer.any", kind, values))
    yield _fault(MAGNETOMETER, "silent", Entry("magnetometer.all", "silent"))
