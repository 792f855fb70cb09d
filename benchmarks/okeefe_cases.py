# SPDX-License-Identifier: Apache-2.0
"""Flies cases of okeefe_2013 with both estimators, gyro on and off, and compares with O'Keefe & Schaub 2013.

    ./sunpoint shell -c "python benchmarks/okeefe_cases.py --cases 20"

Each case draws initial attitude, rates and noise; the four configurations of a case share their draws. The
paper's figures are those of its 1000 cases: mean error of Fig. 6 after one orbit, longest convergence of Fig. 8.
"""

import argparse
import json
import statistics
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from css_common.mission import load_mission
from css_studies.direct_flight import configured, fly_directly
from css_studies.estimate_errors import heading_errors
from css_studies.flight_metrics import estimator_runs, sunlit_passes

# estimator, gyro: mean error [deg] and longest convergence [min] in the paper
PAPER = {
    ("wavg", True): (4.99, 3.0),
    ("wavg", False): (4.94, 7.5),
    ("ekf", True): (2.38, 3.0),
    ("ekf", False): (2.51, 20.0),
}
LATE = 300.0  # [s] sunlit time at the end of the flight over which the late error is averaged


def fly(mission_name: str, overrides: list[str], case: int, estimator: str, gyro: bool) -> dict[str, Any]:
    """One flight and what is reported of it."""
    mission = configured(load_mission(mission_name, overrides), case=case, estimator=estimator, gyro=gyro)
    log = fly_directly(mission)
    (run,) = estimator_runs(log, [estimator])
    steps, errors = heading_errors(log, estimator)
    sunlit = errors[log.sunlit[steps]]
    passes = sunlit_passes(log)
    return run | {
        "case": case,
        "late_heading_error_deg": float(np.degrees(sunlit[-round(LATE / log.period) :].mean())),
        "acquired_s": [sun.acquired_s for sun in passes],
        "converging_s": [sun.converging_s for sun in passes],
    }


def summary(runs: list[dict[str, Any]], estimator: str, gyro: bool) -> list[str]:
    """One row of the table."""
    chosen = [
        run for run in runs if run["estimator"] == estimator and run["gyro"] == ("on" if gyro else "off")
    ]

    def values(key: str) -> list[float]:
        return [run[key] for run in chosen if run[key] is not None]

    minutes = [run["power_positive_s"] / 60.0 for run in chosen if run["power_positive_s"] is not None]
    first = [run["converging_s"][0] / 60.0 for run in chosen]
    later = [sum(run["converging_s"][1:]) / 60.0 for run in chosen]
    error, longest = PAPER[estimator, gyro]
    mean = statistics.fmean
    return [
        f"{estimator}, gyro {'on' if gyro else 'off'}",
        f"{mean(values('heading_error_mean_deg')):.2f}",
        f"{mean(values('heading_error_p95_deg')):.2f}",
        f"{mean(values('late_heading_error_deg')):.2f}",
        f"{error:.2f}",
        f"{mean(minutes):.2f}",
        f"{max(minutes):.2f}",
        f"{longest:g}",
        f"{max(first):.2f}",
        f"{max(later):.2f}",
        f"{mean(values('rate_final_deg_s')):.3f}",
        f"{len(minutes)}/{len(chosen)}",
    ]


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mission", default="okeefe_2013", help="mission to fly (default: %(default)s)")
    parser.add_argument(
        "--cases", type=int, default=20, help="cases of each configuration (default: %(default)s)"
    )
    parser.add_argument("--workers", type=int, default=1, help="processes (default: %(default)s)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides")
    parser.add_argument("--json", metavar="FILE", help="write the figures of every flight")
    options = parser.parse_args()
    jobs = [
        (options.mission, options.overrides, case, *kind) for case in range(options.cases) for kind in PAPER
    ]
    began = time.perf_counter()
    with ProcessPoolExecutor(options.workers) as pool:
        runs = list(pool.map(fly, *zip(*jobs, strict=True)))
    table = Table(
        box=box.SIMPLE_HEAD, title=f"{options.mission}, {options.cases} cases", title_justify="left"
    )
    for heading in (
        "configuration", "error\nmean\ndeg", "error\n95 %\ndeg", "error\nlate\ndeg", "paper\nmean\ndeg",
        "converging\nmean\nmin", "converging\nmax\nmin", "paper\nmax\nmin", "first\nmax\nmin",
        "after\neclipse\nmax, min", "final\nrate\ndeg/s", "con-\nverged",
    ):  # fmt: skip
        table.add_column(heading, justify="left" if heading == "configuration" else "right")
    for estimator, gyro in PAPER:
        table.add_row(*summary(runs, estimator, gyro))
    console = Console(highlight=False, width=120)
    console.print(table)
    console.print(f"{len(runs)} flights in {time.perf_counter() - began:.0f} s")
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(runs, file, allow_nan=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
