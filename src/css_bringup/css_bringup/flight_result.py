# SPDX-License-Identifier: Apache-2.0
"""What every way to fly a mission gives back, and where its recording goes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from css_bringup.incidents import lost_messages
from css_common import places
from css_common.mission import Mission
from css_recording.bag_folder import free_name

Progress = Callable[[float], None]
"""Called now and then with the simulated seconds flown."""

Stopped = Callable[[], bool]
"""True once the flight is asked to end early."""


@dataclass
class FlightResult:
    """A flight that ended, well or not.

    Attributes:
        mission: what flew.
        simulated_s: simulated time covered [s].
        wall_s: wall time of the loop, start-up not counted [s].
        cpu_s: processor time of all processes over the same time [s].
        steps: control cycles flown.
        bag: recording, if any.
        recorded: messages recorded, by absolute topic name.
        failure: why the flight ended early; empty on a good end.
        interrupted: the user asked it to end.
        notes: what was not as it should be (restarts, refusals, silence, losses).
        domain: ROS domain that it had for itself; None when nobody chose one.
        warnings: what the checks before the flight found doubtful.
    """

    mission: Mission
    simulated_s: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    steps: int = 0
    bag: Path | None = None
    recorded: Mapping[str, int] = field(default_factory=dict)
    failure: str = ""
    interrupted: bool = False
    notes: list[str] = field(default_factory=list)
    domain: int | None = None
    warnings: list[str] = field(default_factory=list)

    @property
    def realtime_factor(self) -> float:
        """Simulated time over wall time."""
        return self.simulated_s / self.wall_s if self.wall_s > 0.0 else 0.0

    @property
    def messages_recorded(self) -> int:
        """Messages of all topics of the graph in the recording."""
        return sum(self.recorded.values())

    @property
    def messages_lost(self) -> int:
        """Messages that the cycles flown must have produced and the recording lacks."""
        if self.bag is None:
            return 0
        return sum(lost_messages(self.mission, self.steps, self.recorded).values())

    def note_losses(self) -> None:
        """Adds to the notes what the recording lacks."""
        if self.bag is not None:
            lost = lost_messages(self.mission, self.steps, self.recorded)
            self.notes += [f"{topic}: {count} messages are not in the recording" for topic, count in lost.items()]


def as_flown(mission: Mission, *, recorded: bool) -> Mission:
    """A mission as its nodes get it in a flight: only nodes of the graph are heard, and a recorder is waited for."""
    overrides = ["io.writers=graph"]
    if recorded:
        overrides += [f"lockstep.recorders={mission.values.lockstep.recorders + 1}", "lockstep.wait_for_recorder=true"]
    return mission.with_overrides(overrides)


def default_bag(mission: Mission, folder: Path | None = None) -> Path:
    """A fresh recording folder `bags/MISSION_case_TIME`, in the project when there is one."""
    root = folder or places.results("bags")
    now = datetime.now(UTC).strftime("%Y%m%d_%H%M%S")
    return free_name(root / f"{mission.name}_{mission.values.mission.case}_{now}")
