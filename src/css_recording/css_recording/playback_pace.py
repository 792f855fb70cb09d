# SPDX-License-Identifier: Apache-2.0
"""When each stamp of a recording is due on the wall clock, while the rate changes and the playback is held."""

import math
from collections.abc import Callable


class PlaybackPace:
    """Recorded time against the wall clock.

    Held, nothing is due but what is granted, message by message or stamp by stamp. A playback that is late, because
    its rate cannot be kept, does not hurry to make up for it after a change.

    Attributes:
        paused: the playback is held.
    """

    def __init__(self, rate: float, now: Callable[[], float], *, paused: bool = False) -> None:
        """Begins held or not.

        Args:
            rate: recorded seconds per second of the wall clock; infinite: everything is due at once.
            now: wall clock [s].
            paused: begin held.
        """
        self.paused = paused
        self._rate = rate
        self._now = now
        self._anchor_ns, self._anchored = 0.0, now()
        self._next_ns = 0
        self._messages = 0
        self._whole_stamp = False
        self._sought_ns: int | None = None

    @property
    def rate(self) -> float:
        """Recorded seconds per second of the wall clock."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._anchor(self._position())
        self._rate = rate

    def start(self, stamp_ns: int) -> None:
        """Recorded time is `stamp_ns` now."""
        self._next_ns = stamp_ns
        self._anchor(stamp_ns)

    def pause(self) -> None:
        """Holds the playback."""
        self._anchor(self._position())
        self.paused = True

    def resume(self) -> None:
        """Goes on from where it was held."""
        self.paused = False
        self._messages, self._whole_stamp = 0, False
        self._anchor(self._anchor_ns)

    def grant_message(self) -> None:
        """Makes one more message due while held."""
        self._messages += 1

    def grant_stamp(self) -> None:
        """Makes all messages of the next stamp due while held."""
        self._whole_stamp = True

    def wait(self, stamp_ns: int) -> float:
        """Seconds of the wall clock until the next message, of this stamp, is due; infinite while held."""
        self._next_ns = stamp_ns
        if self.paused:
            return 0.0 if self._messages or self._whole_stamp else math.inf
        if self._rate == math.inf:
            return 0.0
        return max(0.0, (stamp_ns - self._anchor_ns) * 1e-9 / self._rate - (self._now() - self._anchored))

    def seek(self, stamp_ns: int) -> None:
        """Asks the playback to go on from a stamp; held, it plays that one alone."""
        self._sought_ns = stamp_ns
        if self.paused:
            self.grant_stamp()

    @property
    def seeks(self) -> bool:
        """It is asked to go elsewhere."""
        return self._sought_ns is not None

    def take_sought(self) -> int | None:
        """The stamp that it is asked to go on from, which is then obeyed; None without."""
        sought, self._sought_ns = self._sought_ns, None
        return sought

    def played(self, stamp_ns: int) -> None:
        """A message was played while held."""
        self._anchor(stamp_ns)
        if not self._whole_stamp:
            self._messages -= 1

    def stamp_is_over(self) -> None:
        """All messages of a stamp have been played."""
        self._whole_stamp = False

    def _position(self) -> float:
        """Recorded time [ns] now; never beyond the stamp that is to come."""
        if self.paused:
            return self._anchor_ns
        if self._rate == math.inf:
            return self._next_ns
        return min(self._next_ns, self._anchor_ns + 1e9 * self._rate * (self._now() - self._anchored))

    def _anchor(self, position_ns: float) -> None:
        self._anchor_ns, self._anchored = position_ns, self._now()
