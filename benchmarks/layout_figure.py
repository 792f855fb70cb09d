# SPDX-License-Identifier: Apache-2.0
"""Studies of several layouts beside each other, with 95 % intervals.

Of `./sunpoint layout okeefe_2013 --cells 8 --pointing 0.8 --out layouts` and two studies:
./sunpoint shell -c "python benchmarks/layout_figure.py studies/pyramid studies/found -o docs/images/layout.png"
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from css_monte_carlo.study import read_study
from css_monte_carlo.study_summary import configuration_objects

QUANTITIES = {
    "heading_error_mean_deg": "heading error, mean [deg]",
    "heading_error_p95_deg": "heading error, 95 % [deg]",
    "converging_mean_s": "converging, mean [s]",
}


def main() -> None:
    """Draws the figure, and prints what it shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="+", type=Path, help="folders of studies")
    parser.add_argument("-o", "--out", type=Path, required=True, help="file of the figure")
    options = parser.parse_args()
    found = {folder.name: configuration_objects(read_study(folder)) for folder in options.studies}
    figure, axes = plt.subplots(1, len(QUANTITIES), figsize=(4.0 * len(QUANTITIES), 3.6), layout="constrained")
    for axis, (name, label) in zip(axes, QUANTITIES.items(), strict=True):
        for gyro, offset, marker in (("on", -0.1, "o"), ("off", 0.1, "s")):
            rows = [next(row for row in of_one if row["gyro"] == gyro) for of_one in found.values()]
            values = [row[name] for row in rows]
            ends = [row["interval_95"][name] for row in rows]
            below = [value - low for value, (low, _) in zip(values, ends, strict=True)]
            above = [high - value for value, (_, high) in zip(values, ends, strict=True)]
            at = [i + offset for i in range(len(rows))]
            axis.errorbar(at, values, yerr=[below, above], fmt=marker, capsize=4, label=f"gyro {gyro}")
            for study, value, (low, high) in zip(found, values, ends, strict=True):
                print(f"{study:30} gyro {gyro:3}  {name:24} {value:8.3f}  {low:8.3f} to {high:8.3f}")
        axis.set_xticks(range(len(found)), [study.replace("_", "\n") for study in found])
        axis.set_xlim(-0.5, len(found) - 0.5)
        axis.set_ylim(bottom=0.0)
        axis.set_ylabel(label)
    axes[0].legend()
    figure.savefig(options.out, dpi=110)


if __name__ == "__main__":
    main()
