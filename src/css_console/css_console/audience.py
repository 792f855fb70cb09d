# SPDX-License-Identifier: Apache-2.0
"""The browsers that watch: for each kind of message one place with the latest, so that a slow one holds nobody up.

What a browser has not fetched is replaced by what is newer. A browser that is stopped therefore costs one message of
each kind, whatever the flight does meanwhile, and sees the present when it goes on.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable

_ANSWERS = 64
REPLACED = ("scene", "history", "frame", "nodes", "log")
"""Kinds of messages of which the latest counts, in the order in which they are sent."""


class Spectator:
    """One browser.

    Attributes:
        replaced: messages that never went out, because a newer one took their place.
    """

    def __init__(self) -> None:
        self.replaced = 0
        self._latest: dict[str, str] = {}
        self._answers: deque[str] = deque(maxlen=_ANSWERS)
        self._there = asyncio.Event()

    @property
    def waiting(self) -> int:
        """Messages that wait to be sent, besides the one that is under way."""
        return len(self._latest) + len(self._answers)

    def give(self, kind: str, text: str) -> None:
        """Puts a message in the place of the last of its kind."""
        self.replaced += kind in self._latest
        self._latest[kind] = text
        self._there.set()

    def answer(self, text: str) -> None:
        """An answer to an order of this browser; of too many the oldest are lost."""
        self._answers.append(text)
        self._there.set()

    async def next(self) -> list[str]:
        """What there is to send, once there is anything."""
        await self._there.wait()
        self._there.clear()
        latest, self._latest = self._latest, {}
        answers = list(self._answers)
        self._answers.clear()
        return [*(latest[kind] for kind in REPLACED if kind in latest), *answers]


class Audience:
    """All of them.

    Attributes:
        spectators: who watches now.
    """

    def __init__(self) -> None:
        self.spectators: set[Spectator] = set()

    def __len__(self) -> int:
        return len(self.spectators)

    def enter(self, spectator: Spectator, state: Iterable[tuple[str, str]] = ()) -> None:
        """One more.

        Args:
            spectator: who comes.
            state: kinds and messages that say what there is now.
        """
        for kind, text in state:
            spectator.give(kind, text)
        self.spectators.add(spectator)

    def leave(self, spectator: Spectator) -> None:
        """One less."""
        self.spectators.discard(spectator)

    def show(self, kind: str, text: Callable[[], str]) -> None:
        """A message for all, which is made if there is anybody."""
        made = text() if self.spectators else ""
        for spectator in self.spectators:
            spectator.give(kind, made)
