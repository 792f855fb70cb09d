# SPDX-License-Identifier: Apache-2.0
"""Changes one line of the packages at a time and looks whether a test fails: what survives is not tested.

Mutants (sign, operator, comparison, number, condition, statement, index; `mutations.py`) are drawn with a fixed seed,
evenly over the packages, in each by lines. Each is tested in a copy of the project, in which kernels are compiled as
ever, by the test files of its package that import its module, directly or not, nearest first, then by a few of other
packages, to the first failure. That test has to fail once more, and to pass without the mutant; another one is left
out. Limits are in processor time: a test that takes too long has noticed the mutant; when all of them together take
too long the verdict is open.

Verdicts are lines of JSON in a file; what stands there is not tested again, so that a run can be continued. The last
line is one JSON object. Survivors that do the same as the original, or that no test should tell from it, are listed in
`equivalent_mutants.json`, with the reason, and do not count. A draw is that of the sources as they are: once they have
changed, `--known` judges the mutants of the file again instead of others.

    ./sunpoint shell -c "python benchmarks/mutants.py --quick --count 200 --seed 1 --minutes 120"
    ./sunpoint shell -c "python benchmarks/mutants.py --known --again survived"
"""

import argparse
import difflib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from mutations import Mutation, mutations
from relevant_tests import Sources

ROOT = Path(__file__).resolve().parents[1]
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.json")
COPIED = (
    "src", "tests", "tools", "config", "bags/reference", "bags/README.md", "docs", "benchmarks",
    "conftest.py", "pyproject.toml", "README.md", "LICENSE", "sunpoint",
)  # fmt: skip
TEST_LIMIT = 100.0  # [s] of processor time for one test, kernels that it has compiled included
_PYTEST = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "one_test")
KILLED, SURVIVED, OPEN, EQUAL = "killed", "survived", "open", "equivalent"


class Mutant(NamedTuple):
    """One change of one file."""

    file: Path  # relative to the project
    mutation: Mutation
    source: bytes

    @property
    def name(self) -> str:
        """Where it is, and the changed lines before and after."""
        changed = [line for line in difflib.ndiff(*self._texts) if line[:2] in ("- ", "+ ")]
        before, after = (" ".join(line[2:].strip() for line in changed if line[0] == sign) for sign in "-+")
        return f"{self.file}: {before} -> {after}"

    @property
    def diff(self) -> str:
        """As `diff -u` shows it, without the names."""
        return "\n".join(list(difflib.unified_diff(*self._texts, n=1, lineterm=""))[2:])

    @property
    def _texts(self) -> tuple[list[str], list[str]]:
        return self.source.decode().splitlines(), self.mutation.applied(self.source).decode().splitlines()


def draw(root: Path, seed: int, count: int) -> Iterator[Mutant]:
    """Mutants of the packages in turn, in each of a line drawn from all that can be changed."""
    lines: dict[str, dict[tuple[Path, int], list[Mutant]]] = defaultdict(lambda: defaultdict(list))
    for file in Sources(root).modules.values():
        source, place = file.read_bytes(), file.relative_to(root)
        for mutation in mutations(source):
            lines[place.parts[1]][place, mutation.line].append(Mutant(place, mutation, source))
    dice = random.Random(seed)
    packages = sorted(lines)
    waiting = {name: dice.sample(sorted(lines[name]), len(lines[name])) for name in packages}
    for number in range(count):
        package = packages[number % len(packages)]
        if waiting[package]:
            yield dice.choice(lines[package][waiting[package].pop()])


def recall(root: Path, names: Iterable[str]) -> Iterator[Mutant]:
    """Mutants by their names, the first of several called the same; what the sources no longer hold is left out."""
    wanted: dict[Path, set[str]] = defaultdict(set)
    for name in names:
        wanted[Path(name.partition(": ")[0])].add(name)
    for place, waiting in wanted.items():
        source = (root / place).read_bytes() if (root / place).is_file() else b""
        lines = source.decode().splitlines()
        for mutation in mutations(source):
            # a name begins with its line; comparing the texts of every mutant would take minutes
            if any(name.startswith(f"{place}: {lines[mutation.line - 1].strip()}") for name in waiting):
                mutant = Mutant(place, mutation, source)
                if mutant.name in waiting:
                    waiting.remove(mutant.name)
                    yield mutant


class Trial:
    """A copy of the project in which mutants are tested."""

    def __init__(self, root: Path, copy: Path, options: argparse.Namespace) -> None:
        self._root, self._copy, self._seconds, self._beyond = root, copy, options.seconds, options.beyond
        self._chosen = ("-m", "not long") if options.quick else ()
        for name in COPIED:
            if (root / name).is_dir():
                shutil.copytree(root / name, copy / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(root / name, copy / name)
        self._kernels = copy / ".cache" / "kernels"
        if (root / ".cache" / "kernels").is_dir():
            shutil.copytree(root / ".cache" / "kernels", self._kernels)
        self._sources = Sources(copy)
        self._sound: dict[str, bool] = {}  # whether a test passes without a mutant
        self._written = int(time.time())

    def test(self, mutant: Mutant) -> dict[str, Any]:
        """Verdict, and the test that failed."""
        began, left = time.time(), self._seconds
        own, others = self._sources.seen_by(self._copy / mutant.file, self._beyond)
        self._write(mutant.file, mutant.mutation.applied(mutant.source))
        verdict, by = SURVIVED, ""
        for files in filter(None, (own, others)):
            outcome, by, used = self._confirmed(mutant, files, left)
            left -= used
            if outcome != SURVIVED or left <= 0.0:
                verdict = outcome if outcome != SURVIVED else OPEN
                break
        self._write(mutant.file, mutant.source)
        return {"verdict": verdict, "by": by, "cpu_s": round(self._seconds - left, 1), "wall_s": time.time() - began}

    def _confirmed(self, mutant: Mutant, files: list[Path], seconds: float) -> tuple[str, str, float]:
        """As `_run`; a test that failed has to fail again by itself, and to pass without the mutant."""
        doubtful: list[str] = []
        while True:
            outcome, by, used = self._run(files, seconds, doubtful)
            if outcome == KILLED and not by:
                self._insist_on_tests(mutant, files)
            if outcome != KILLED or not by or by in doubtful:
                return outcome, by, used
            if self._passes_without(mutant, by) and self._run([by], seconds)[0] == KILLED:
                return outcome, by, used
            doubtful.append(by)

    def _passes_without(self, mutant: Mutant, test: str) -> bool:
        if test not in self._sound:
            self._write(mutant.file, mutant.source)
            outcome, _, _ = self._run([test], self._seconds)
            self._sound[test] = outcome == SURVIVED
            self._write(mutant.file, mutant.mutation.applied(mutant.source))
        return self._sound[test]

    def _insist_on_tests(self, mutant: Mutant, files: list[Path]) -> None:
        """A run that fails before its first test is a verdict only where the sources as they are get that far."""
        self._write(mutant.file, mutant.source)
        names = [str(file.relative_to(self._copy)) for file in files]
        collected = subprocess.run(
            [*_PYTEST, "--collect-only", *names],
            cwd=self._copy,
            env=self._environment(self._copy / "progress.json"),
            capture_output=True,
            text=True,
        )
        if collected.returncode not in (0, 5):
            said = (collected.stdout + collected.stderr).strip()
            raise SystemExit(
                f"mutants: without a mutant the tests do not start either (after ./sunpoint test?):\n{said}"
            )
        self._write(mutant.file, mutant.mutation.applied(mutant.source))

    def _write(self, file: Path, source: bytes) -> None:
        place = self._copy / file
        place.write_bytes(source)
        self._written += 2  # bytecode is told from its source by seconds and size
        os.utime(place, (self._written, self._written))

    def _run(
        self, files: list[Path] | list[str], seconds: float, left_out: Iterable[str] = ()
    ) -> tuple[str, str, float]:
        """Verdict of some tests, the one that failed or was under way, and the processor time used [s]."""
        progress = self._copy / "progress.json"
        progress.unlink(missing_ok=True)
        broken = {*left_out, *(test for test, sound in self._sound.items() if not sound)}
        names = [str(file.relative_to(self._copy)) if isinstance(file, Path) else file for file in files]
        command = [*_PYTEST, *self._chosen, "-x", "--tb=no"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        process = subprocess.Popen(
            [*command, *(f"--deselect={test}" for test in sorted(broken)), *names],
            cwd=self._copy,
            env=self._environment(progress),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 3)),
        )
        try:
            # a test that waits and uses no processor time is ended by pytest's own limit
            process.wait()
        finally:
            _end(process)
            self._forget_kernels()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        noted: dict[str, Any] = {"test": "", "cpu_s": 0.0} | (
            json.loads(progress.read_text()) if progress.exists() else {}
        )
        if process.returncode in (0, 5):  # all passed, or there was none
            return SURVIVED, "", used
        if process.returncode < 0:  # it ran out of processor time, or fell over
            slow = -process.returncode == signal.SIGXCPU and used - noted["cpu_s"] < TEST_LIMIT
            return (OPEN if slow else KILLED), noted["test"], used
        return KILLED, noted.get("failed", noted["test"]), used

    def _environment(self, progress: Path) -> dict[str, str]:
        packages = [str(place) for place in sorted((self._copy / "src").iterdir()) if place.name != "css_msgs"]
        own = [*packages, str(self._copy / "benchmarks")]
        return os.environ | {
            "PYTHONPATH": os.pathsep.join([*own, os.environ.get("PYTHONPATH", "")]),
            "PYTHONPYCACHEPREFIX": str(self._copy / ".cache" / "bytecode"),
            "SUNPOINT_HOME": str(self._copy),
            "MUTANT_PROGRESS": str(progress),
        }

    def _forget_kernels(self) -> None:
        """Kernels of mutants are compiled once and never needed again."""
        known = {place.name for place in (self._root / ".cache" / "kernels").glob("*")}
        for place in self._kernels.glob("*"):
            if place.name not in known:
                shutil.rmtree(place, ignore_errors=True)


def _end(process: subprocess.Popen) -> None:
    """Ends a run and what its tests have started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def tested(options: argparse.Namespace, known: dict[str, dict[str, Any]]) -> Iterator[tuple[Mutant, dict[str, Any]]]:
    """Mutants with their verdicts, those that are known without a test."""
    end = time.monotonic() + 60.0 * options.minutes
    mutants = recall(ROOT, known) if options.known else draw(ROOT, options.seed, options.count)
    equal = equivalent()
    with tempfile.TemporaryDirectory(prefix="sunpoint-mutants-") as folder:
        trial = None
        for mutant in mutants:
            verdict = known.get(mutant.name)
            if verdict is None or (verdict["verdict"] in options.again and mutant.name not in equal):
                if time.monotonic() > end:
                    continue
                trial = trial or Trial(ROOT, Path(folder) / "project", options)
                verdict = {"mutant": mutant.name, "kind": mutant.mutation.kind, **trial.test(mutant)}
                with options.verdicts.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(verdict) + "\n")
                print(f"{verdict['verdict']:9} {mutant.name}  {verdict['by']}", flush=True)
            yield mutant, verdict


def equivalent() -> set[str]:
    """Mutants that do the same as the original; why stands beside them."""
    return {entry["mutant"] for entry in json.loads(EQUIVALENT.read_text(encoding="utf-8"))}


def summary(found: list[tuple[Mutant, dict[str, Any]]]) -> dict[str, Any]:
    """Prints the survivors with their changes; the score, of all and by package."""
    equal = equivalent()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for mutant, verdict in found:
        outcome = EQUAL if verdict["verdict"] == SURVIVED and mutant.name in equal else verdict["verdict"]
        counts[mutant.file.parts[1]][outcome] += 1
        if outcome == SURVIVED:
            print(f"\nsurvived: {mutant.file}, {mutant.mutation.kind}\n{mutant.diff}")
    total = sum(counts.values(), Counter())
    print()
    for package in sorted(counts):
        print(f"{package:18} {_score(counts[package])}")
    judged = total[KILLED] + total[SURVIVED]
    return {"mutants": len(found), **total, "score": round(total[KILLED] / judged, 3) if judged else None}


def _score(counts: Counter[str]) -> str:
    judged = counts[KILLED] + counts[SURVIVED]
    share = f"{counts[KILLED] / judged:4.0%}" if judged else "   -"
    return f"{share}  {', '.join(f'{counts[key]} {key}' for key in (KILLED, SURVIVED, EQUAL, OPEN) if counts[key])}"


def read_verdicts(file: Path) -> dict[str, dict[str, Any]]:
    """Verdicts of a file by mutant, the later ones of several."""
    if not file.exists():
        return {}
    lines = (json.loads(line) for line in file.read_text(encoding="utf-8").splitlines())
    return {verdict["mutant"]: verdict for verdict in lines}


def main() -> int:
    """Tests the mutants and prints what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, metavar="N", help="mutants (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the draw (default: %(default)s)")
    parser.add_argument("--minutes", type=float, default=120.0, metavar="N", help="wall time (default: %(default)s)")
    parser.add_argument(
        "--seconds", type=float, default=400.0, metavar="N", help="processor time for a mutant (default: %(default)s)"
    )
    parser.add_argument(
        "--beyond", type=int, default=4, metavar="N", help="test files of other packages (default: %(default)s)"
    )
    parser.add_argument(
        "--quick", action="store_true", help="without the longest tests; what survives is to be judged again with them"
    )
    parser.add_argument(
        "--again", action="append", default=[], choices=(SURVIVED, OPEN, KILLED), help="test those once more"
    )
    parser.add_argument(
        "--known", action="store_true", help="the mutants of the verdicts, whatever is drawn now: sources have changed"
    )
    parser.add_argument(
        "--verdicts", type=Path, default=ROOT / "log" / "mutants.jsonl", metavar="FILE", help="default: %(default)s"
    )
    options = parser.parse_args()
    options.verdicts.parent.mkdir(parents=True, exist_ok=True)
    found, interrupted = [], False
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        for entry in tested(options, read_verdicts(options.verdicts)):
            found.append(entry)
    except KeyboardInterrupt:
        interrupted = True
    result = summary(found)
    print(json.dumps({"seed": None if options.known else options.seed, **result}))
    if interrupted:
        print("mutants: interrupted; the same command goes on from here", file=sys.stderr)
        return 128 + signal.SIGINT
    return 0


if __name__ == "__main__":
    sys.exit(main())
