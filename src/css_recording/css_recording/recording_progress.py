# SPDX-License-Identifier: Apache-2.0
"""How far a flight is recorded: the stamp up to which no topic of the mission lacks a message. No ROS here.

The plant is told and does not go further ahead than its topics hold, so that nothing is lost when the recorder is
stopped, slow, or matched late with a node that was restarted.
"""

from collections.abc import Collection, Mapping


class RecordingProgress:
    """Follows the stamps of the topics that have a message every so many steps."""

    def __init__(self, spacing_ns: Mapping[str, int], epoch_ns: int, period_ns: int, every: int) -> None:
        """Begins before the first step.

        Args:
            spacing_ns: time from message to message of each topic [ns].
            epoch_ns: stamp of the first step.
            period_ns: control cycle [ns].
            every: steps after which progress is worth telling.
        """
        self._spacing_ns = dict(spacing_ns)
        self._period_ns = period_ns
        self._every_ns = every * period_ns
        self._last = {topic: epoch_ns - spacing for topic, spacing in self._spacing_ns.items()}
        self._speaking = set(self._last)
        self._due = epoch_ns + self._every_ns
        self._unmoved: dict[str, tuple[int, float]] = {}

    @property
    def complete_ns(self) -> int:
        """Stamp up to which every topic that speaks has all its messages."""
        ends = [self._last[topic] + self._spacing_ns[topic] for topic in self._speaking]
        return min(ends, default=max(self._last.values(), default=0) + self._period_ns) - self._period_ns

    def note(self, topic: str, stamp_ns: int) -> int | None:
        """Takes the stamp of a message; the progress when it is worth telling."""
        if topic not in self._last:
            return None
        if stamp_ns > self._last[topic]:
            self._last[topic] = stamp_ns
        if topic not in self._speaking:
            self._speaking.add(topic)
        return self._told() if stamp_ns >= self._due else None

    def give_up_silent(
        self, now: float, limit: float, except_for: Collection[str] = ()
    ) -> tuple[list[str], int | None]:
        """Leaves out, until they speak again, topics that are behind the others and have been silent for too long.

        Args:
            now: any clock [s].
            limit: silence that counts as too long [s].
            except_for: topics that are silent on purpose, left out at once when they are behind.

        Returns:
            The topics newly left out, and the progress when it is worth telling now.
        """
        newest = max(self._last.values(), default=0)
        given_up = []
        for topic in sorted(self._speaking):
            last, since = self._unmoved.get(topic, (None, now))
            if last != self._last[topic]:
                self._unmoved[topic] = (self._last[topic], now)
                since = now
            behind = newest - self._last[topic] >= self._spacing_ns[topic] + self._every_ns
            if behind and (now - since >= limit or topic in except_for):
                given_up.append(topic)
        self._speaking.difference_update(given_up)
        return given_up, self._told() if given_up else None

    def _told(self) -> int | None:
        complete = self.complete_ns
        if complete < self._due:
            return None
        self._due = complete + self._every_ns
        return complete
