# SPDX-License-Identifier: Apache-2.0
"""Damages recordings in many ways and looks at what is made of them: read, replayed, recovered, or refused in words.

Each damaged copy is handled in a process of its own with limits on memory and time. Wrong is what differs from the
recording without a word of it; wrong results, tracebacks, time-outs and breaches of the memory limit must be none.
"""

import argparse
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from bag_damage import DAMAGES
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from css_bringup.replay_bag import mission_of_bag, replay
from css_bringup.replay_pass import parse_request
from css_common.mission_file import MissionError
from css_recording.bag_reader import BagReader
from css_recording.bag_storage import NO_CHECK_SUM
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_recording.recovery import recover
from css_recording.schemas import schema_of, store_of, types_of

REFERENCE = Path(__file__).parents[1] / "bags" / "reference"
SECONDS = 20
_MEMORY_BYTES = 1500 << 20
_TIME_LIMIT_S = 60  # of processor time, and ten times that by the clock
_TOPICS = ("/truth", "/css/voltages", "/gyro/imu", "/ekf/sun_estimate")
MISSION = "okeefe_2013"
"""What flew in the recordings."""
_FAILURES = ("WRONG", "traceback", "memory", "time-out")

Contents = list[tuple[str, int, bytes]]


class Word:
    """What was read from a recording, and everything that was said with it."""

    def __init__(self, bag: Path) -> None:
        with BagReader(bag) as reader:
            self.messages: Contents = [(m.topic, m.stamp_ns, m.data) for m in reader.messages()]
            self.mission = reader.mission_text
            self.said = {*reader.notes, *map(str, reader.refused)}


def estimates(bag: Path, out: Path) -> tuple[list[bytes], set[str]]:
    """Estimates that replay gives, and what it says."""
    with BagReader(bag) as reader:
        name = MISSION if reader.mission_text is None else None  # SQLite has no place for one
    result = replay(bag, out, mission_of_bag(bag, {}, [], name), [parse_request("ekf")], {})
    said = {*result.reports, *(f"{topic} {kinds}" for topic, kinds in result.rejected.items())}
    with BagReader(out) as reader:
        found = [m.data for m in reader.messages(["/ekf/sun_estimate"])]
    return found, said


# The recordings that are damaged


def make_sources(folder: Path) -> dict[str, Path]:
    """A short recording as it was written before there were check sums, as today, in two files, and as SQLite."""
    sources = {name: folder / name for name in ("unchecked", "checked", "split", "sqlite")}
    shutil.copytree(REFERENCE, sources["unchecked"])
    os.rename(sources["unchecked"] / "reference_0.mcap", sources["unchecked"] / "unchecked_0.mcap")
    recover(sources["unchecked"])
    with BagReader(REFERENCE) as reader:
        end_ns = reader.start_ns + SECONDS * 10**9
        topics = [entry.topic for entry in reader.topics if entry.topic.name in _TOPICS]
        messages = list(reader.messages(_TOPICS, None, end_ns))
        description = reader.description
    half = len(messages) // 2
    for name, file_name, part in (
        ("checked", "checked_0.mcap", messages),
        ("split", "split_0.mcap", messages[:half]),
        ("second", "split_1.mcap", messages[half:]),
    ):
        with BagWriter(folder / name, topics, description, file_name=file_name) as writer:
            for message in part:
                writer.write(message.topic, message.stamp_ns, message.data)
    shutil.copyfile(folder / "second" / "split_1.mcap", sources["split"] / "split_1.mcap")
    (sources["split"] / "metadata.yaml").unlink()
    recover(sources["split"])
    with RosbagsWriter(sources["sqlite"], version=9, storage_plugin=StoragePlugin.SQLITE3) as out:
        connections = {
            t.name: out.add_connection(t.name, t.type, typestore=store_of(types_of(schema_of(t.type)))) for t in topics
        }
        for message in messages:
            out.write(connections[message.topic], message.stamp_ns, message.data)
    return sources


# One damaged recording


class Trial:
    """What is made of one damaged copy."""

    def __init__(self, sound: Word, replayed: list[bytes], replay_said: set[str], checked: bool) -> None:
        self.sound, self.replayed, self.replay_said = sound, replayed, replay_said
        self.checked = checked
        self.known = set(sound.messages)

    def read(self, bag: Path) -> str:
        """The recording as it is."""
        word = Word(bag)
        if word.messages == self.sound.messages and word.mission == self.sound.mission:
            return "identical"
        return self._judged(word.said - self.sound.said)

    def replay(self, bag: Path) -> str:
        """Its estimates."""
        found, said = estimates(bag, bag.with_name("replay"))
        return "identical" if found == self.replayed else self._judged(said - self.replay_said)

    def recover(self, bag: Path) -> str:
        """Mended in place, or what can be saved into another folder; it must be readable afterwards."""
        try:
            report = recover(bag)
        except BagError as error:
            _one_line(error)
            report = recover(bag, bag.with_name("saved"))
        word = Word(report.recording)
        strange = [message for message in word.messages if message not in self.known]
        if strange and self.checked:
            return "WRONG"
        if word.messages == self.sound.messages and word.mission == self.sound.mission:
            return "identical"
        said = {*report.losses, *report.notes} - self.sound.said
        return self._judged(said if word.said - self.sound.said else set())

    def _judged(self, said: set[str]) -> str:
        if said:
            return "loss named"
        return "WRONG" if self.checked else "no check sum, as said"


def _one_line(error: Exception) -> None:
    assert "\n" not in str(error), f"more than one line: {error}"


def _outcome(action: Callable[[Path], str], bag: Path) -> str:
    try:
        return action(bag)
    except (BagError, MissionError) as error:
        _one_line(error)
        return "refused"
    except MemoryError:
        return "memory"
    except Exception:
        traceback.print_exc()
        return "traceback"


def _in_a_process(work: Callable[[], dict[str, str]]) -> dict[str, str]:
    """Do work with limits on memory and time."""
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + _MEMORY_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CPU, (_TIME_LIMIT_S, _TIME_LIMIT_S))
        signal.alarm(10 * _TIME_LIMIT_S)
        result = work()
        os.write(write_end, json.dumps(result).encode())
        os._exit(0)
    os.close(write_end)
    with os.fdopen(read_end, "rb") as pipe:
        text = pipe.read()
    _, status = os.waitpid(child, 0)
    if text:
        return dict(json.loads(text))
    ended_by = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    late = ended_by in (signal.SIGALRM, signal.SIGXCPU, signal.SIGKILL)
    return {"all": "time-out" if late else "memory"}


def _try(trial: Trial, source: Path, folder: Path, damage: str, seed: str) -> dict[str, str]:
    shutil.rmtree(folder, ignore_errors=True)
    outcomes = {}
    for name, action in (("read", trial.read), ("replay", trial.replay), ("recover", trial.recover)):
        bag = shutil.copytree(source, folder / name / source.name)
        DAMAGES[damage](bag, random.Random(seed))
        outcomes[name] = _outcome(action, bag)
    return outcomes


def main() -> int:
    """Entry point; 1 when anything was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="recordings to damage (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the damages (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first one (default: %(default)s)")
    options = parser.parse_args()
    began = time.monotonic()
    counts: dict[str, Counter[str]] = {"read": Counter(), "replay": Counter(), "recover": Counter()}
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        sources = make_sources(Path(folder) / "sources")
        trials = {name: _trial(bag, Path(folder) / f"{name}_replay") for name, bag in sources.items()}
        done = 0
        with suppress(KeyboardInterrupt):  # what was done until then is told
            for number in range(options.first, options.first + options.count):
                seed = f"{options.seed}/{number}"
                dice = random.Random(seed)
                name, damage = dice.choice(list(sources)), dice.choice(list(DAMAGES))
                work = Path(folder) / "work"
                outcomes = _in_a_process(lambda: _try(trials[name], sources[name], work, damage, seed))  # noqa: B023
                done += 1
                for action, outcome in outcomes.items():
                    counts.setdefault(action, Counter())[outcome] += 1
                    if outcome in _FAILURES:
                        failures.append(f"{seed}: {name}, {damage}, {action}: {outcome}")
                        print(failures[-1], file=sys.stderr, flush=True)
    result = {"bags": done, "seed": options.seed, "seconds": round(time.monotonic() - began, 1), **counts}
    print(json.dumps(result | {"failures": failures}))
    return 1 if failures else 0


def _trial(bag: Path, out: Path) -> Trial:
    word = Word(bag)
    found, said = estimates(bag, out)
    checked = not any(note == NO_CHECK_SUM or "check sum" in note for note in word.said)
    return Trial(word, found, said, checked)


if __name__ == "__main__":
    sys.exit(main())
