# SPDX-License-Identifier: Apache-2.0
"""Cells with scale errors of 5 to 20 % and tilts of 3 deg, calibrated by simulated flights.

How often the true values lie within the stated error, and how headings err before, after, and with cells that are known
exactly. The scale error of a case is normal with 5, 10, 15 or 20 %, in turn. The first two thirds of a flight
calibrate, headings are measured on the last third. Each parameter is held against its standard deviation, and all that
were told in a case together against their covariance: the chi-square of a case, which is what a statement about a whole
calibration has to be, for of thirty normal errors one in twelve cases has one beyond three sigma. The last line is a
JSON object; the exit code is 1 when fewer than 99 % of the parameters lie within three of their standard deviations, or
when the mean heading error of an estimator after calibration is more than 10 % above that with known cells.

    python benchmarks/calibration_recovery.py --cases 200 --reference truth
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2, kstest

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from uncalibrated import (
    Flown,
    aid_error_ratios,
    error_ratios,
    flown,
    mean_headings,
    mission_of,
    sun_alone,
    true_parameters,
    without_truth,
)

from css_calibration.calibration import Calibration, calibrate
from css_calibration.errors import CalibrationError
from css_calibration.recorded import Recorded

_SCALES = (0.05, 0.10, 0.15, 0.20)
_PART = 2.0 / 3.0
_RECORDINGS = {"truth": lambda flight: flight.recorded, "batch": without_truth, "sun": sun_alone}
_SIGMAS = 3.0
_ESTIMATORS = ("ekf", "sun_filter")
_QUANTILES = (0.5, 0.9, 0.99)
_NAMES = ("scale", "dark", "tilt 1", "tilt 2")


def first_part(recorded: Recorded) -> Recorded:
    """What calibrates."""
    return recorded.at(np.flatnonzero(recorded.time < _PART * recorded.time[-1]))


def chi_square(flight: Flown, c: Calibration) -> tuple[float, int]:
    """Of the errors of all parameters of cells that were told, with their covariance, and how many these are."""
    unknowns = c.fit.unknowns
    told = c.observed & unknowns.free
    told[:, len(_NAMES) :] = False
    at = unknowns.column_of()[told]
    covariance = c.fit.covariance[np.ix_(at, at)] * np.outer(unknowns.sigma[at], unknowns.sigma[at])
    off = (c.fit.parameters - true_parameters(flight.mission))[told]
    return float(off @ np.linalg.solve(covariance, off)), len(at)


def main() -> int:
    """Runs the cases and prints what they came to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--reference", choices=tuple(_RECORDINGS), default="truth")
    options = parser.parse_args()
    began, cells, aids, errors, joint, refused = time.monotonic(), [], [], [], [], 0
    for case in range(options.first, options.first + options.cases):
        scale = _SCALES[case % len(_SCALES)]
        flight = flown(mission_of(f"mission.case={case}", f"css_array.scale_cell_error={scale}"))
        recorded = first_part(_RECORDINGS[options.reference](flight))
        asked = "batch" if options.reference == "batch" else "truth"
        try:
            c = calibrate(recorded, reference=asked, curve="okeefe", holdout=0.0)
        except CalibrationError as error:
            print(f"case {case}: {error}", flush=True)
            refused += 1
            continue
        of_cells = error_ratios(flight, c)[:, : len(_NAMES)]
        cells.append(of_cells)
        aids.append(aid_error_ratios(flight, c))
        joint.append(chi_square(flight, c))
        after_s = _PART * flight.recorded.time[-1]
        errors.append([np.degrees(mean_headings(flight, c, name, after_s)) for name in _ESTIMATORS])
        worst = np.nanmax(np.abs(of_cells)) if np.isfinite(of_cells).any() else float("nan")
        shown = "; ".join(" ".join(f"{e:.3f}" for e in row) for row in errors[-1])
        told, wall_s = np.isfinite(of_cells).mean(), time.monotonic() - began
        print(
            f"case {case}: observed {told:.2f}, worst {worst:.2f} sigma, chi-square {joint[-1][0]:.1f} of "
            f"{joint[-1][1]}, heading {shown} deg, {wall_s:.0f} s",
            flush=True,
        )
    return _verdict(options.reference, np.array(cells), np.array(aids), np.array(errors), np.array(joint), refused)


def _of_chi_squares(joint: np.ndarray) -> dict[str, Any]:
    """Chi-squares of cases (K, 2), each with its number of parameters, against the distribution of true ones."""
    values, counts = joint.T
    probabilities = chi2.cdf(values, counts)
    return {
        "mean_over_parameters": float(values.sum() / counts.sum()),
        "share_of_cases_below_quantile": {f"{q:g}": float(np.mean(probabilities <= q)) for q in _QUANTILES},
        "kolmogorov_smirnov_p": float(kstest(probabilities, "uniform").pvalue),
    }


def _verdict(
    reference: str, cells: np.ndarray, aids: np.ndarray, errors: np.ndarray, joint: np.ndarray, refused: int
) -> int:
    told = np.abs(cells[np.isfinite(cells)])
    within = float(np.mean(told <= _SIGMAS))
    case_within = np.array([np.nanmax(np.abs(case)) <= _SIGMAS for case in cells if np.isfinite(case).any()])
    whole = errors[np.isfinite(errors).all(axis=(1, 2))]
    mean = whole.mean(axis=0)
    over = mean[:, 1] / mean[:, 2]
    result = {
        "reference": reference,
        "cases": len(cells),
        "refused": refused,
        "parameters_told": len(told),
        "share_told": float(np.isfinite(cells).mean()),
        "share_within_3_sigma": within,
        "share_of_cases_with_all_within_3_sigma": float(case_within.mean()),
        "the_same_of_normal_errors": float(np.mean([math.erf(_SIGMAS / math.sqrt(2.0)) ** n for _, n in joint])),
        "chi_square": _of_chi_squares(joint),
        "rms_over_sigma": {n: float(np.sqrt(np.nanmean(cells[:, :, k] ** 2))) for k, n in enumerate(_NAMES)},
        "aids_within_3_sigma": float(np.mean(np.abs(aids) <= _SIGMAS)) if aids.size else None,
        "heading_cases": len(whole),
        "heading_deg": {
            name: {"before": b, "after": a, "known": k, "after_over_known": a / k}
            for name, (b, a, k) in zip(_ESTIMATORS, mean.tolist(), strict=True)
        },
    }
    print(json.dumps(result))
    return 0 if within >= 0.99 and float(over.max()) <= 1.1 else 1


if __name__ == "__main__":
    sys.exit(main())
