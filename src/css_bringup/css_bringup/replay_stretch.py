# SPDX-License-Identifier: Apache-2.0
"""A stretch of a recording that holds nothing out of the ordinary, taken by all estimators at once.

Most of a flight is of that kind: every message whole, every input there, its stamps rising, nothing due to happen.
What comes from it is what comes of taking it message by message, many times faster. Whether a stretch is ordinary is
found before anything is taken of it.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from css_bringup.replayed import Replayed
from css_common.codec import Sample
from css_common.component import Cycles
from css_common.edge import Edge
from css_common.message_columns import Columns
from css_recording.bag_reader import BagMessage

STRETCH = 12_000
"""Messages of one stretch, about."""

Listeners = Mapping[str, list[tuple[Edge, list[Replayed]]]]
"""Who takes the messages of a topic: checks, and the estimators that share them."""


class _Heard(NamedTuple):
    """The messages of one input."""

    edge: Edge
    columns: Columns
    places: np.ndarray


class Given(NamedTuple):
    """A message of an estimator."""

    place: int  # of the message of the stretch that completed its inputs
    topic: str
    stamp_ns: int
    data: bytes


def stretches(messages: Iterable[BagMessage]) -> Iterator[list[BagMessage]]:
    """A recording in parts, cut where the log time changes: inputs of one stamp mostly stand together."""
    part: list[BagMessage] = []
    for message in messages:
        if len(part) >= STRETCH and message.stamp_ns != part[-1].stamp_ns:
            yield part
            part = []
        part.append(message)
    if part:
        yield part


class Stretch:
    """A part of a recording whose messages are all ordinary, for every estimator."""

    def __init__(self, messages: list[BagMessage], heard: list[tuple[Replayed, dict[str, _Heard]]]) -> None:
        self._messages = messages
        self._heard = heard
        self._cycles: list[tuple[Cycles, np.ndarray]] = []

    @staticmethod
    def of(messages: list[BagMessage], listeners: Listeners, runs: Iterable[Replayed]) -> "Stretch | None":
        """The stretch of some messages; None where one of them, or what happens meanwhile, is out of the ordinary."""
        places: dict[str, list[int]] = {}
        for place, message in enumerate(messages):
            places.setdefault(message.topic, []).append(place)
        heard: dict[int, dict[str, _Heard]] = {id(run): {} for run in runs}
        for topic in listeners.keys() & places.keys():
            at = places[topic]
            for edge, takers in listeners[topic]:
                columns = edge.ordinary([messages[place].data for place in at])
                if columns is None:
                    return None
                for run in takers:
                    heard[id(run)][edge.source.key] = _Heard(edge, columns, np.array(at))
        stretch = Stretch(messages, [(run, heard[id(run)]) for run in runs])
        return stretch if stretch._is_matched() else None

    def _is_matched(self) -> bool:
        """Finds the cycles of each estimator; False where inputs of one are missing, or something happens to it."""
        for run, heard in self._heard:
            columns = {key: entry.columns for key, entry in heard.items()}
            found = run.matcher.ordinary(columns, {key: entry.places for key, entry in heard.items()})
            if found is None or not run.is_quiet(int(found[0].stamps_ns[-1])):
                return False
            self._cycles.append(found)
        return True

    def spans(self) -> list[tuple[int, int]]:
        """First and last stamp of the messages of each input."""
        return [(int(columns.stamp_ns[0]), int(columns.stamp_ns[-1])) for _, columns in self._edges()]

    def take(self) -> list[Given]:
        """Steps all estimators; their messages in the order in which they come when messages are taken one by one."""
        for edge, columns in self._edges():
            edge.take(columns)
        given: list[Given] = []
        for (run, heard), (cycles, complete) in zip(self._heard, self._cycles, strict=True):
            run.matcher.take({key: entry.columns for key, entry in heard.items()}, cycles)
            places = complete.tolist()
            of_steps = run.steps(cycles, partial(self._received, run, heard, cycles))
            given += [Given(places[step], topic, stamp_ns, data) for step, topic, stamp_ns, data in of_steps]
        given.sort(key=lambda message: message.place)
        return given

    def _edges(self) -> list[tuple[Edge, Columns]]:
        edges = {id(entry.edge): (entry.edge, entry.columns) for _, heard in self._heard for entry in heard.values()}
        return list(edges.values())

    def _received(
        self, run: Replayed, heard: Mapping[str, _Heard], cycles: Cycles, step: int
    ) -> dict[str, Sample | None]:
        """The inputs of one cycle, as the matching gives them."""
        received: dict[str, Sample | None] = dict.fromkeys(run.matcher.inputs)
        for key, rows in cycles.rows.items():
            row = int(np.searchsorted(rows, step))
            if row < len(rows) and rows[row] == step:
                entry = heard[key]
                received[key] = entry.edge.codec.decode(self._messages[entry.places[row]].data)
        return received
