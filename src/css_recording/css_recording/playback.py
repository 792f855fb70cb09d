# SPDX-License-Identifier: Apache-2.0
"""How a recording is to be played, and what became of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from rclpy.qos import QoSProfile


class PlaybackError(Exception):
    """The live nodes do not take part in the playback. The text names the topic."""


@dataclass
class PlaybackOptions:
    """How a recording is played.

    Attributes:
        rate: recorded seconds per second of the wall clock; infinite: as fast as it goes.
        wait_for: lockstep: topics that must answer each stamp; then the rate only limits.
        pace: topic whose stamps are answered; default: the one with most messages.
        patience: wall time [s] allowed for nodes to appear and for each answer.
        clock: publish the recorded time on /clock.
        start, end: span to play [s] after the first message.
        topics: only these; None: all.
        paused: begin held.
        loop: begin again at the end, with the same stamps.
        stay: wait at the end for a place to go to.
        qos: quality of service of topics that are not to have the strongest.
    """

    rate: float = 1.0
    wait_for: tuple[str, ...] = ()
    pace: str | None = None
    patience: float = 30.0
    clock: bool = False
    start: float = 0.0
    end: float | None = None
    topics: tuple[str, ...] | None = None
    paused: bool = False
    loop: bool = False
    stay: bool = False
    qos: Mapping[str, QoSProfile] = field(default_factory=dict)


@dataclass
class PlaybackReport:
    """What was played.

    Attributes:
        published: messages of each topic.
        left_to_live_nodes: topics that were not published because a live node publishes them.
        not_installed: topics whose type is not known here.
        stamps: different stamps played.
        stopped: it was ended before its end.
    """

    published: dict[str, int] = field(default_factory=dict)
    left_to_live_nodes: list[str] = field(default_factory=list)
    not_installed: list[str] = field(default_factory=list)
    stamps: int = 0
    stopped: bool = False
