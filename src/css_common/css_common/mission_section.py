# SPDX-License-Identifier: Apache-2.0
"""The section `mission`: its name, its time, its steps and the key of its random streams."""

import math
import re
from collections.abc import Iterator

from css_common.epochs import parse_utc
from css_common.schema import Table, Values, integer, real, shown, text
from css_common.section import Section

_LAST_STAMP_NS = 2**31 * 1_000_000_000
_NAME = re.compile(r"\w[\w !#$%&'()+,\-.;=@\[\]^`{}~]*")  # nothing that a file system takes for its own
_LONGEST_NAME = 100  # [bytes] with what is added to it a file name of 255 bytes
_MOST_STEPS = 10**9

EPOCH = text("mission.epoch", "", "UTC instant of the first step", example='mission: {epoch: "2026-06-01T00:00:00Z"}')
EPOCH_SPREAD = real(
    "mission.epoch_spread_days",
    0.0,
    "d",
    "cases begin at instants within so many days after the epoch, each at one of its own",
    low=0.0,
    high=20_000.0,
)
DURATION = real(
    "mission.duration",
    None,
    "s",
    "simulated time to fly",
    low=0.0,
    open_low=True,
    high=3.2e8,
    example="mission: {duration: 5550.0}",
)
PERIOD = real("mission.period", 0.1, "s", "control cycle", low=0.001, high=60.0)
SEED = integer("mission.seed", 1, "-", "key of all random streams", low=0, high=2**63 - 1)
CASE = integer("mission.case", 0, "-", "case number within the seed", low=0, high=2**32 - 1)

MISSION: Table = (
    text("mission.name", "unnamed", "name of the mission, as in the file name"),
    text("mission.description", "", "one line for reports"),
    EPOCH,
    EPOCH_SPREAD,
    DURATION,
    PERIOD,
    SEED,
    CASE,
)


def name_for_files(text: str) -> str:
    """A text made a `mission.name`: what no name may hold becomes `_`, and what is too long is cut off."""
    kept = "".join(letter if letter == "_" or _NAME.fullmatch(f"_{letter}") else "_" for letter in text)
    if not _NAME.match(kept):
        kept = f"_{kept}"
    return kept.encode()[:_LONGEST_NAME].decode(errors="ignore")


def _mission_conflicts(mission: Values) -> Iterator[str]:
    if not _NAME.fullmatch(mission.name) or len(mission.name.encode()) > _LONGEST_NAME:
        yield (
            f"mission.name: {shown(mission.name)} given, expected a name for files of at most {_LONGEST_NAME} bytes: "
            "letters, digits, spaces and _-+.,=() and the like, the first a letter or digit"
        )
    duration = 0.0 if math.isnan(mission.duration) else mission.duration
    steps = duration / mission.period
    if duration and not 1.0 - 1e-6 <= steps <= _MOST_STEPS:
        yield (
            f"mission.duration: {mission.duration:g} s given, {steps:.3g} steps of mission.period {mission.period:g} s,"
            f" expected 1 to {_MOST_STEPS}"
        )
    if not mission.epoch:
        return
    try:
        begin = parse_utc(mission.epoch)
    except ValueError as error:
        yield f"mission.epoch: {error}"
        return
    spread_s = mission.epoch_spread_days * 86_400.0
    if begin < 0 or begin + (spread_s + duration) * 1e9 >= _LAST_STAMP_NS:
        yield (
            f"mission.epoch: {mission.epoch} given, expected {f'a flight of {duration:g} s' if duration else 'one'} "
            "between 1970-01-01 and 2038-01-19: the seconds of a ROS stamp have 32 bits"
        )


SECTIONS = {"mission": Section(MISSION, _mission_conflicts)}
