# SPDX-License-Identifier: Apache-2.0
"""Every mission flown for an orbit, exported, and compared with its flight on every processor that can be run here.

Prints a table of what `./sunpoint export --verify` found. Ends with a JSON object; the exit code is 1 when a flight or
an export failed, or a step differs by more than the last bits of named functions.

    python benchmarks/exported_missions.py --missions okeefe_2013 --duration 600
    python benchmarks/exported_missions.py --mathematics musl --steps 3000 --targets x86_64 aarch64 cortex-m7
    python benchmarks/exported_missions.py --folder whole_orbits

With a folder, recordings and results are kept there, a mission after the other, and what is there is not made again.
"""

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from rich.console import Console

from css_analysis.readable_table import ReadableTable

ROOT = Path(__file__).parents[1]
_TARGETS = ("x86_64", "aarch64", "riscv64", "armv7")


def main() -> int:
    """Flies, exports, compares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = sorted(file.stem for file in (ROOT / "config").glob("*.yaml"))
    parser.add_argument("--missions", nargs="+", default=every, metavar="NAME", help="default: all in config/")
    parser.add_argument("--duration", type=float, metavar="S", help="of a flight [s]; default: the mission's")
    parser.add_argument("--steps", type=int, metavar="N", help="compared of each component; default: all that flew")
    parser.add_argument("--mathematics", choices=("target", "musl"), default="target", help="as of `export`")
    parser.add_argument("--targets", nargs="+", default=list(_TARGETS), metavar="NAME")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="where to keep recordings and results, and go on")
    options = parser.parse_args()
    results: list[dict[str, Any]] = []
    failed: list[str] = []
    with contextlib.ExitStack() as stack:
        folder = options.folder or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        for mission in options.missions:
            told, code = _kept(mission, options, folder / mission)
            results += [{"mission": mission, **result} for result in told]
            if code != 0:
                failed.append(mission)
    _print(results)
    print(json.dumps({"results": results, "failed": failed}))
    return 1 if failed else 0


def _kept(mission: str, options: argparse.Namespace, folder: Path) -> tuple[list[dict[str, Any]], int]:
    """What came of a mission, from the file of an earlier run with the same options where there is one."""
    asked = [options.duration, options.steps, options.mathematics, options.targets]
    file = folder / "results.json"
    if file.is_file():
        known = json.loads(file.read_text())
        if known["asked"] == asked:
            return known["results"], known["code"]
    results, code = _compared(mission, options, folder)
    if results:
        file.write_text(json.dumps({"asked": asked, "results": results, "code": code}))
    return results, code


def _compared(mission: str, options: argparse.Namespace, folder: Path) -> tuple[list[dict[str, Any]], int]:
    bag = folder / "bag"
    length = [] if options.duration is None else ["--duration", f"{options.duration}"]
    # a flight may miss a criterion of its mission and be a flight nevertheless
    if not _has_flown(bag) and _run("fly", mission, *length, "--out", str(bag)).returncode not in (0, 1):
        return [], 1
    most = [] if options.steps is None else ["--steps", f"{options.steps}"]
    asked = ["--target", *options.targets, "--mathematics", options.mathematics, "--verify", str(bag), *most]
    done = _run("export", mission, *asked, "-o", str(folder), "--json")
    lines = done.stdout.splitlines()
    if not lines or not lines[-1].startswith("{"):
        return [], 1
    return json.loads(lines[-1])["results"], done.returncode


def _has_flown(bag: Path) -> bool:
    # what describes a recording is written at its end
    return (bag / "metadata.yaml").is_file()


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(ROOT / "sunpoint"), *arguments], stdout=subprocess.PIPE, text=True, check=False)


def _print(results: list[dict[str, Any]]) -> None:
    table = ReadableTable()
    for heading in ("mission", "library", "target"):
        table.add_name(heading)
    for heading in ("code\n[bytes]", "stack\n[bytes]", "operations\nat most", "steps", "equal", "largest\ndifference"):
        table.add_number(heading)
    table.add_name("differing functions")
    for r in results:
        compared = [f"{r[key]}" for key in ("steps", "equal_steps", "largest_relative_difference")]
        sizes = [f"{r[key]}" for key in ("code_bytes", "stack_bytes", "operations_at_most")]
        named = ", ".join(r["differing_functions"] or {}) or r["not_run"] or ""
        table.add_texts([r["mission"], r["component"], r["target"], *sizes, *compared, named])
    Console(highlight=False).print(table)


if __name__ == "__main__":
    sys.exit(main())
