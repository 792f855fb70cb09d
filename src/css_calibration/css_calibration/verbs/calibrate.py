# SPDX-License-Identifier: Apache-2.0
"""Calibrates as the options say, prints what was found and writes the file."""

import argparse
import json
from pathlib import Path

from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_calibration.calibration import CURVES, Calibration, calibrate
from css_calibration.calibration_result import (
    Row,
    calibration_file,
    mean_deg,
    outlier_rows,
    residual_rows,
    result_object,
    rows_of,
    unobserved_combinations,
)
from css_calibration.cell_fit_model import GAIN, TILT_1, TILT_2
from css_calibration.errors import CalibrationError
from css_calibration.estimator_gain import CONFIDENCE, Gain, Gains, gain_object, gains_of, worse_lines
from css_calibration.mission_of import recorded_by
from css_calibration.step_lines import step_lines
from css_common.command import FAILED, complain
from css_common.mission import find_mission
from css_common.progress_lines import still_working
from css_common.whole_files import write_whole

_CELL_HEADINGS = {
    "scale": "scale\n[-]",
    "dark": "dark\n[-]",
    "tilt_1": "tilt 1\n[deg]",
    "tilt_2": "tilt 2\n[deg]",
    "temperature_coefficient": "by temperature\n[%/K]",
}
_SAME_DEG = 1e-3  # of cells that were right already a calibration changes headings by rounding
_PERCENT = {"temperature_coefficient": 100.0}


def run(prog: str, options: argparse.Namespace) -> int:
    """Calibrates as the options say; the exit code."""
    file = options.out or _default_file(options.bag)
    if file.exists() and not options.overwrite:
        raise CalibrationError(f"{file}: there is such a file; --overwrite replaces it, --out FILE names another")
    if options.extends is not None:
        find_mission(options.extends)
    assert options.response == "auto" or options.response in CURVES
    with still_working(f"calibrating by {options.bag}"):
        recorded = recorded_by(options)
        tell = step_lines()
        result = calibrate(
            recorded, reference=options.reference, curve=options.response, holdout=options.holdout, tell=tell
        )
        worth = gains_of(result, options, tell)
    text = calibration_file(result, str(options.bag), options.extends)
    write_whole(file, text)
    _print(result, worth, Console(highlight=False, markup=False))
    print(f"calibration: {file}")
    if options.json:
        found = result_object(result, str(options.bag), str(file)) | gain_object(worth)
        print(json.dumps(found, allow_nan=False))
    wrong = [line for line in (_shortcoming(result), *worse_lines(result, worth.gains)) if line]
    for line in wrong:
        complain(prog, line, "not as it should be")
    return FAILED if wrong else 0


def _default_file(bag: Path) -> Path:
    return bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_calibration.yaml")


def _shortcoming(result: Calibration) -> str:
    if not result.observed.any():
        return "no parameter of any cell was told"
    if not result.observed[:, [GAIN, TILT_1, TILT_2]].any():
        return "dark levels alone were told, no scale and no tilt: expected minutes of sunlight on each cell"
    before, after = mean_deg(result.before), mean_deg(result.after)
    if before is not None and after is not None and after > before + _SAME_DEG:
        return f"the heading of the part that was held out errs by {after:.3f} deg, by {before:.3f} before"
    return ""


def _print(result: Calibration, worth: Gains, console: Console) -> None:
    rows = rows_of(result)
    console.print(_cell_table(result, rows))
    others = [row for row in rows if row.cell is None]
    if others:
        table = ReadableTable()
        table.add_name("besides")
        table.add_number("value")
        table.add_number("1 sigma")
        for row in others:
            name = f"{row.name} [{row.unit}]" if row.unit != "-" else row.name
            table.add_texts([name, f"{row.value:.5g}" if row.observable else "not told", f"{row.sigma:.2g}"])
        console.print(table)
    if residual_rows(result):
        console.print(_residual_table(result))
    for outlier in outlier_rows(result):
        console.print(
            f"left out: {outlier['outputs']} of {outlier['of']} outputs of cell {outlier['cell']}, from "
            f"{outlier['from']} to {outlier['to']}, up to {outlier['largest']:.3f} off",
            soft_wrap=True,
        )
    for line in unobserved_combinations(result):
        console.print(f"not told: {line}", soft_wrap=True)
    for line in (*result.notes, *worth.notes):
        console.print(f"noted: {line}", soft_wrap=True)
    before, after = mean_deg(result.before), mean_deg(result.after)
    if before is None or after is None:
        console.print("heading error: not measured, no instant that was held out has cells that tell a direction")
    else:
        console.print(
            f"heading by cells alone, {len(result.before)} instants held out: {before:.3f} deg, {after:.3f} calibrated"
        )
    if worth.gains:
        console.print(_gain_table(worth.gains))


def _gain_table(gains: list[Gain]) -> ReadableTable:
    """Heading errors of each estimator before and after."""
    table = ReadableTable(f"mean heading error of the part that was held out, interval of {100.0 * CONFIDENCE:.0f} %")
    table.add_name("estimator")
    for heading in ("before\n[deg]", "calibrated\n[deg]", "change\n[deg]", "interval\n[deg]", "instants"):
        table.add_number(heading)
    table.add_name("leaves out\nmore cells")
    for gain in gains:
        interval = "-" if gain.interval_deg is None else f"{gain.interval_deg:.3f}"
        angles = [f"{x:.3f}" for x in (gain.before_deg, gain.after_deg)]
        change = f"{gain.after_deg - gain.before_deg:+.3f}"
        cells = ", ".join(str(cell.cell) for cell in gain.left_out)
        table.add_texts([gain.estimator, *angles, change, interval, f"{gain.instants}", cells])
    return table


def _cell_table(result: Calibration, rows: list[Row]) -> ReadableTable:
    recorded = result.recorded
    table = ReadableTable(
        f"{recorded.mission.name}: {len(result.left)} cells, {len(recorded.stamp_ns)} instants, reference: "
        f"{result.reference}, response: {result.curve}"
    )
    names = [name for name in _CELL_HEADINGS if any(row.name == name for row in rows)]
    table.add_name("cell")
    for name in names:
        table.add_number(_CELL_HEADINGS[name])
        table.add_number("1 sigma")
    by_place = {(row.cell, row.name): row for row in rows}
    for cell in range(len(result.left)):
        texts = [f"{cell}"]
        for name in names:
            row, factor = by_place[cell, name], _PERCENT.get(name, 1.0)
            texts += [f"{factor * row.value:.4f}" if row.observable else "not told", f"{factor * row.sigma:.4f}"]
        table.add_texts(texts)
    return table


def _residual_table(result: Calibration) -> ReadableTable:
    """Mean and rms of residuals against incidence, in thousandths."""
    rows = residual_rows(result)
    bins = sorted({(row["from_deg"], row["to_deg"]) for row in rows})
    table = ReadableTable("residuals by incidence of the Sun: mean / rms [0.001]")
    table.add_name("cell")
    for low, high in bins:
        table.add_number(f"{low:.0f} to\n{high:.0f} deg")
    by_place = {(row["cell"], row["from_deg"]): row for row in rows}
    for cell in range(len(result.left)):
        found = [by_place.get((cell, low)) for low, _ in bins]
        table.add_texts(
            [f"{cell}", *("-" if row is None else f"{1e3 * row['mean']:.1f} / {1e3 * row['rms']:.1f}" for row in found)]
        )
    return table
