# SPDX-License-Identifier: Apache-2.0
"""Writes what viewers draw of a recording."""

import argparse
import json
from collections.abc import Iterator
from heapq import merge
from operator import attrgetter
from pathlib import Path

from css_common.command import FAILED
from css_common.progress_lines import still_working
from css_recording.bag_metadata import Topic
from css_recording.bag_reader import BagMessage, BagReader
from css_recording.bag_writer import BagWriter
from css_viewers.definitions import definition_of
from css_viewers.errors import ViewerError
from css_viewers.viewed_bag import Drawn, ViewedBag, mission_of


def run(options: argparse.Namespace) -> int:
    """Writes a recording for viewers, or a file for Rerun; the exit code."""
    with BagReader(options.bag) as reader:
        viewed = ViewedBag(reader, mission_of(reader, options.mission), options.every)
        with still_working(f"drawing {options.bag}"):
            if options.rerun is not None:
                file = options.rerun
                _write_rerun(viewed, file)
            else:
                file = options.output or _beside(options.bag)
                _write_bag(reader, viewed, file, options.overwrite)
        told = [f"not drawn, as the recording has no {topic}" for topic in viewed.absent]
        told += [*viewed.reports, *map(str, reader.refused), *(f"note: {note}" for note in reader.notes)]
        refused = viewed.refused + sum(one.count for one in reader.refused)
    print(f"{file}: {viewed.drawn} messages for viewers, {viewed.seconds:.1f} s of flight")
    for line in told:
        print(line)
    if options.json:
        written = {"file": str(file), "messages": viewed.drawn, "seconds": viewed.seconds}
        print(json.dumps({**written, "refused": refused, "notes": told}, allow_nan=False))
    return FAILED if refused else 0


def _beside(bag: Path) -> Path:
    whole = bag.parent if bag.is_file() else bag
    return whole.with_name(f"{whole.name}_viewers")


def _write_bag(reader: BagReader, viewed: ViewedBag, folder: Path, overwrite: bool) -> None:
    """Copies the recording and adds what is drawn."""
    there = {entry.topic.name for entry in reader.topics}
    drawn = {name: kind for name, kind in viewed.topics.items()}
    if there & drawn.keys():
        raise ViewerError(f"{reader.path}: has {', '.join(sorted(there & drawn.keys()))} already; open it as it is")
    topics = [entry.topic for entry in reader.topics]
    topics += [Topic(name, kind, schema=definition_of(kind)) for name, kind in drawn.items()]
    with BagWriter(folder, topics, dict(reader.description), overwrite=overwrite) as writer:
        both: Iterator[Drawn | BagMessage] = merge(viewed.messages(), reader.messages(), key=attrgetter("stamp_ns"))
        for message in both:
            writer.write(message.topic, message.stamp_ns, message.data)


def _write_rerun(viewed: ViewedBag, file: Path) -> None:
    from css_viewers.rerun_file import write_rerun  # not everybody has it

    write_rerun(viewed, file)
