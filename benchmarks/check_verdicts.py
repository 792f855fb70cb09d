# SPDX-License-Identifier: Apache-2.0
"""What `check` makes of recordings with one fault each: right verdicts, wrong ones, misses, and false ones.

Each kind of fault of a cell is flown on several missions, from a third of the flight on, and once more without. A fault
that changes fewer than ten outputs by more than 0.1 shows nothing and is counted apart. A verdict is right when its
cell fails and its kind is the one that was flown, or one that reads the same: a frozen cell is stuck, one that reads
nothing is dead, all light lost alike is a scale. Kinds that a verdict names as not told apart count as one of several,
cells of which it says that there is not enough evidence as not told. False is every cell without a fault that is
accused. The last line is a
JSON object; the exit code is 1 when one in ten verdicts is wrong, missing or false.

    python benchmarks/check_verdicts.py --cases 2 --reference truth
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from faulted_cells import FAULTS, MISSIONS, faulted
from uncalibrated import flown, without_truth

from css_calibration.check import check
from css_calibration.verdicts import HEALTHY


def main() -> int:
    """Flies, checks and counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="case to begin with: others than those it was tuned on")
    parser.add_argument("--reference", choices=("truth", "batch", "cells"), default="truth")
    parser.add_argument("--missions", nargs="+", choices=tuple(MISSIONS), default=list(MISSIONS))
    options = parser.parse_args()
    total: Counter[str] = Counter()
    began = time.monotonic()
    for name in options.missions:
        for case in range(options.first, options.first + options.cases):
            healthy = None
            for kind in (None, *FAULTS):
                flight = flown(faulted(name, case, kind))
                healthy = flight if kind is None else healthy
                assert healthy is not None
                recorded = flight.recorded if options.reference == "truth" else without_truth(flight)
                verdicts = [v for v in check(recorded, reference=options.reference).verdicts if v.verdict != HEALTHY]
                changed = np.abs(flight.recorded.voltages - healthy.recorded.voltages) > 0.1
                outcome = _outcome(kind, verdicts, changed)
                total.update(outcome)
                said = ", ".join(f"{v.cell} {v.verdict}" for v in verdicts) or "all healthy"
                print(
                    f"{name} {case} {kind}: {said}: {', '.join(outcome)} ({time.monotonic() - began:.0f} s)", flush=True
                )
    print(json.dumps({"reference": options.reference, **total}))
    wrong = total["wrong kind"] + total["missed"] + total["false"]
    return 1 if wrong > 0.1 * (total["right"] + wrong) else 0


def _outcome(kind: str | None, verdicts: list, changed: np.ndarray) -> list[str]:
    failing = set() if kind is None else set(FAULTS[kind].cells)
    outcome = ["false"] * len({v.cell for v in verdicts if v.accuses} - failing)
    if kind is None:
        return outcome or ["right: healthy"]
    for cell in sorted(failing):
        told = {v.verdict for v in verdicts if v.cell == cell and v.accuses}
        among = {word for v in verdicts if v.cell == cell for word in v.others}
        if told & set(FAULTS[kind].names):
            outcome.append("right")
        elif among & set(FAULTS[kind].names):
            outcome.append("one of several")
        elif told:
            outcome.append("wrong kind")
        elif any(v.cell == cell for v in verdicts):
            outcome.append("not told")
        else:
            outcome.append("missed" if changed[:, cell].sum() >= 10 else "does not show")
    return outcome


if __name__ == "__main__":
    sys.exit(main())
