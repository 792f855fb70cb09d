# SPDX-License-Identifier: Apache-2.0
"""Damages missions, parameter files and `--set` texts in many ways and looks what becomes of each.

Each one must be accepted, or refused in one line that names the file or the key. A traceback, a refusal of another
form, or more than two seconds are counted as failures, and so is an accepted mission that cannot be flown: of some that
are accepted all components are made and stepped in this process, which must give finite numbers or a named refusal.
The last line is one JSON object; the exit code is 1 when anything failed.

    python benchmarks/mutated_missions.py --count 10000 --seed 1
"""

import argparse
import json
import random
import re
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from css_common.codec import codec_of
from css_common.mission import Mission, find_component, mission_from_text
from css_common.mission_file import MissionError, dump_sections, flattened, read_sections, read_text
from css_common.node_arguments import mission_of_arguments
from css_common.schema import ParameterError
from css_monte_carlo.direct_flight import fly_and_keep

ROOT = Path(__file__).resolve().parents[1]
LIMIT = 2.0  # [s] wall time of reading one
FLIGHT_LIMIT = 60.0  # [s] of making and stepping its components: kernels may have to be compiled
STEPS = 20
_LONGEST = 5000  # list: one that is doubled again and again would be all that a run is about

WORDS = (
    "", "null", "~", "true", "off", "0", "-1", "1", "1e-4", "1e308", "-1e308", "1e-300", ".inf", "-.inf", ".nan",
    "1:30", "010", "0x1F", "9" * 30, "2013-06-01", "9999-12-31T23:59:59Z", "0001-01-01", "2016-12-31T23:59:60Z", "[]",
    "{}", "[1, 2.0]", "[[1.0]]", "[.nan]", "!!bool foo", "!!python/object:os.system x", "!!binary Zm9v", "!!set {a}",
    "&a 1", "*a", '"\\0"', '"\\x1b[2J"', "../../x", "/etc/passwd", "x" * 5000, "\U0001f680", "a: b", "<<", "|\n x",
    "'", '"', "1.0", "0.0", "-0.0", "1e9", "100.0", "0.5", "3", "2",
)  # fmt: skip
KEYS = ("", "x", "mission.name", "/**", "ros__parameters", "<<", "1", "a.b", "events", "criteria", "\U0001f680",
        "k" * 300)  # fmt: skip
BYTES = (b"\0", b"\xff", b"\xed\xa0\x80", b"\t", b"\r", b"\xef\xbb\xbf", b"{", b"}", b"[", b":", b"-", b"&a ", b"*a")


def mutated_words(text: str, draw: random.Random) -> bytes:
    """A value, a key or a line changed, doubled, moved or taken away."""
    lines = text.splitlines(keepends=True)
    for _ in range(draw.randint(1, 3)):
        at = draw.randrange(len(lines))
        kind = draw.randrange(6)
        if kind == 0:
            lines[at] = re.sub(r":[^:\n]*\n?$", lambda _: f": {draw.choice(WORDS)}\n", lines[at])
        elif kind == 1:
            lines[at] = re.sub(r"[^\s:]+:", lambda _: f"{draw.choice(KEYS)}:", lines[at], count=1)
        elif kind == 2:
            lines.insert(draw.randrange(len(lines) + 1), lines[at])
        elif kind == 3 and len(lines) > 1:
            del lines[at]
        elif kind == 4:
            lines[at] = " " * draw.randint(0, 8) + lines[at].lstrip()
        else:
            lines[at] = re.sub(r"[-+]?\d+\.\d+", lambda _: draw.choice(WORDS), lines[at], count=1)
    return "".join(lines).encode(errors="surrogatepass")


def mutated_bytes(text: str, draw: random.Random) -> bytes:
    """Bytes flipped, put in, or cut off; another encoding."""
    data = bytearray(text.encode())
    kind = draw.randrange(8)
    if kind == 0:
        return bytes(data[: draw.randrange(len(data) + 1)])
    if kind == 1:
        return text.encode(draw.choice(["utf-16", "utf-16-le", "utf-32", "utf-8-sig", "latin-1"]), errors="replace")
    for _ in range(draw.randint(1, 8)):
        at = draw.randrange(len(data))
        if kind < 5:
            data[at] ^= 1 << draw.randrange(8)
        else:
            data[at:at] = draw.choice(BYTES)
    return bytes(data)


def mutated_values(text: str, draw: random.Random) -> bytes:
    """A right file with other values of right kinds."""
    sections = {name: flattened(body) for name, body in read_sections(text, "seed").items()}
    places = [(name, key) for name, flat in sections.items() for key in flat]
    for name, key in draw.sample(places, min(len(places), draw.randint(1, 3))):
        sections[name][key] = other_value(sections[name][key], draw)
    return dump_sections(sections).encode(errors="surrogatepass")


def other_value(value: Any, draw: random.Random) -> Any:
    """A value of the same kind, near or far."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return draw.choice([0.0, -value, value * draw.uniform(0.1, 10.0), value * 10.0 ** draw.randint(-9, 9), 1e308])
    if isinstance(value, int):
        return draw.choice([0, -1, value + 1, value * 1000, 2**31, 2**63 - 1])
    if isinstance(value, list) and value:
        if draw.random() < 0.7:
            return [other_value(value[0], draw), *value[1:]]
        return (value * draw.randint(0, 3))[:_LONGEST]
    return draw.choice(["", "x", "../x", "elements", "tle", "ekf", "n" * 200, "\u00e9"])


def overrides(mission: Mission, draw: random.Random) -> list[str]:
    """Texts for --set: known keys and others, with words of all kinds."""
    known = [*mission.shared, *(f"{node.name}.{key}" for node in mission.nodes for key in node.canonical)]
    made = []
    for _ in range(draw.randint(1, 3)):
        key = draw.choice(known) if draw.random() < 0.9 else draw.choice(KEYS)
        made.append(f"{key}={draw.choice(WORDS)}" if draw.random() < 0.95 else draw.choice(WORDS))
    return made


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raises TimeoutError in what takes longer."""

    def expired(number: int, frame: object) -> None:
        raise TimeoutError(f"more than {seconds:g} s")

    before = signal.signal(signal.SIGALRM, expired)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def named(message: str, origin: str) -> bool:
    """Whether a refusal is one short line that names the file or, for a text of --set, the key."""
    return "\n" not in message and len(message) < 1000 and (origin in message or "override" in message)


def first_not_finite(mission: Mission) -> str | None:
    """Makes all components and steps them; topic and field of the first number that is not finite."""
    short = mission.with_overrides([f"mission.duration={STEPS * mission.values.mission.period!r}"])
    for topic, samples in fly_and_keep(short, short.topics).items():
        codec = codec_of(short.topics[topic])
        for sample in samples:
            bad = codec.first_not_finite(codec.real_fields(), sample)
            if bad is not None:
                return f"{topic}: {bad}"
    return None


class Trial:
    """Counts what becomes of each damaged input."""

    def __init__(self, folder: Path, fly_every: int) -> None:
        self.counts: Counter[str] = Counter()
        self.failures: list[dict[str, str]] = []
        self.slowest = 0.0
        self._file = folder / "mutant.yaml"
        self._fly_every = fly_every

    def read(self, data: bytes, read: Callable[[str], Mission], shown: str, origin: str = "mutant.yaml") -> None:
        """One damaged input, whose refusals name `origin`."""
        self._file.write_bytes(data)
        mission = None
        began = time.process_time()
        try:
            with time_limit(10 * LIMIT):
                mission = read(str(self._file))
        except (MissionError, ParameterError) as error:
            good = named(str(error), origin)
            self._count("refused" if good else "refused without a name", shown, str(error), good)
        except BaseException:
            self._count("traceback", shown, traceback.format_exc(), False)
        else:
            self._count("accepted", shown, "", True)
        seconds = time.process_time() - began
        self.slowest = max(self.slowest, seconds)
        if seconds > LIMIT:
            self._count("slow", shown, f"{seconds:.1f} s", False)
        if mission is not None and self.counts["accepted"] % self._fly_every == 0:
            self._fly(mission, shown)

    def _fly(self, mission: Mission, shown: str) -> None:
        try:
            with time_limit(FLIGHT_LIMIT):
                bad = first_not_finite(mission)
        except (MissionError, ParameterError) as error:
            self._count("flight refused", shown, str(error), "\n" not in str(error))
        except BaseException:
            self._count("flight failed", shown, traceback.format_exc(), False)
        else:
            self._count("flown" if bad is None else "flight not finite", shown, str(bad), bad is None)

    def _count(self, what: str, shown: str, detail: str, good: bool) -> None:
        self.counts[what] += 1
        if not good:
            self.failures.append({"what": what, "input": shown[:3000], "detail": detail[-1500:]})


def run(count: int, seed: int, folder: Path, fly_every: int) -> Trial:
    """Damages and reads `count` inputs; the same seed gives the same ones."""
    draw = random.Random(seed)
    missions = {path.stem: read_text(path) for path in sorted((ROOT / "config").glob("*.yaml"))}
    files = [read_text(path) for path in sorted(ROOT.glob("src/css_common/test/data/parameter_files/*.yaml"))]
    loaded = {name: mission_from_text(text, name) for name, text in missions.items()}
    node = find_component("css_estimation", "ekf")
    mutations = (mutated_words, mutated_bytes, mutated_values)
    trial = Trial(folder, fly_every)
    if fly_every <= count:
        for mission in loaded.values():
            first_not_finite(mission)  # compiles what flies, which is not to be counted
    for _ in range(count):
        name, kind = draw.choice(sorted(missions)), draw.randrange(10)
        if kind < 6:
            data = draw.choice(mutations)(missions[name], draw)
            trial.read(data, lambda file: mission_from_text(read_text(file), file), repr(data))
        elif kind < 8:
            data = draw.choice(mutations)(draw.choice(files), draw)
            arguments = ["-r", f"__ns:={draw.choice(['/', '/sat1'])}"]
            trial.read(data, partial(one_node, node, arguments=arguments), repr((data, arguments)))
        else:
            texts = overrides(loaded[name], draw)
            trial.read(b"", partial(_changed, loaded[name], texts), repr((name, texts)), name)
    return trial


def _changed(mission: Mission, texts: list[str], _: str) -> Mission:
    return mission.with_overrides(texts)


def one_node(node: Any, file: str, arguments: list[str]) -> Mission:
    """The mission of a node that is started by itself with a parameter file."""
    return mission_of_arguments(node, ["--ros-args", "--params-file", file, *arguments])


def main() -> int:
    """Runs the trials and prints what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000, metavar="N", help="inputs (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the damage (default: %(default)s)")
    parser.add_argument("--fly-every", type=int, default=20, metavar="N", help="of the accepted ones (default: 20)")
    options = parser.parse_args()
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        trial = run(options.count, options.seed, Path(folder), options.fly_every)
    for failure in trial.failures:
        print(f"{failure['what']}: {failure['detail']}\n  input: {failure['input']}", file=sys.stderr)
    result = {
        "count": options.count,
        "seed": options.seed,
        "failures": len(trial.failures),
        "slowest_s": round(trial.slowest, 3),
        "cpu_s": round(time.process_time() - began, 1),
        **trial.counts,
    }
    print(json.dumps(result))
    return 1 if trial.failures else 0


if __name__ == "__main__":
    sys.exit(main())
