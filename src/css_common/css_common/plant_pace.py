# SPDX-License-Identifier: Apache-2.0
"""How fast simulated time may go: with the wall clock, as fast as it can, or only as far as it is let."""

from collections.abc import Callable


class PlantPace:
    """What holds simulated time back.

    Attributes:
        paused: no step follows but what is granted.
    """

    def __init__(self, rate: float, changed: Callable[[], None]) -> None:
        """Not held.

        Args:
            rate: simulated seconds per second of the wall clock, above 0; infinite: as fast as it goes.
            changed: called after each change.
        """
        self.paused = False
        self._rate = rate
        self._granted = 0
        self._changed = changed

    @property
    def rate(self) -> float:
        """Simulated seconds per second of the wall clock."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._rate = rate
        self._changed()

    @property
    def free(self) -> bool:
        """Nothing holds the next step back."""
        return self._rate == float("inf") and not self.paused

    def pause(self) -> None:
        """Holds simulated time at the stamp that is reached."""
        self.paused, self._granted = True, 0
        self._changed()

    def resume(self) -> None:
        """Lets it go on."""
        self.paused = False
        self._changed()

    def grant_stamp(self) -> None:
        """Lets one more step follow while held."""
        self._granted += 1
        self._changed()

    def take_granted(self) -> bool:
        """Whether a step is granted, which it is then no more."""
        if not self._granted:
            return False
        self._granted -= 1
        return True
