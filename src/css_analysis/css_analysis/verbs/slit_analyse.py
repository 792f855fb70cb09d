# SPDX-License-Identifier: Apache-2.0
"""Analyses a file of pulses, and prints what it tells."""

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from css_analysis.readable_table import ReadableTable
from css_analysis.slit_file import read_slit_file
from css_common.command import FAILED, complain
from css_common.schema import ParameterError, Values, default_values
from css_common.shared_sections import conflicts
from css_estimation.spin import slit_measurement
from css_estimation.spin.coning import Coning, analyse_coning, justification
from css_estimation.spin.slit_passage import REASONS
from css_estimation.spin.slit_record import SlitRecord, read_record
from css_sensors.slits import SLITS, head_azimuths, slit_inclination


def run(prog: str, options: argparse.Namespace) -> int:
    """Analyses and prints as the options say; the exit code."""
    console = Console(highlight=False)
    values = _values(options)
    record = _record(options, values)
    if not len(record.passages.time):
        complain(prog, f"{options.file}: no passage in {record.pulses} pulses: {_refusals(record)}")
        return FAILED
    windows = _windows(options, values, record)
    result = _result_object(record, windows)
    _print(console, options, record, windows)
    if options.passages is not None:
        _write_passages(options.passages, record)
    for file in _figures(options.figures, record, windows):
        console.print(f"figure: {file}", soft_wrap=True)
    if options.json:
        print(json.dumps(result, allow_nan=False))
    ambiguous = [name for name, coning in windows.items() if coning is not None and coning.rivals]
    for name in ambiguous:
        complain(prog, f"coning, {name}: the period is ambiguous, see the candidates")
    return FAILED if ambiguous else 0


def _values(options: argparse.Namespace) -> Values:
    table = {p.name: p for p in SLITS}
    values = default_values(
        (*SLITS, *slit_measurement.PARAMETERS),
        slits__counter_hz=options.frequency,
        slits__inclination_deg=options.inclination_deg,
        slits__head_azimuths_deg=table["slits.head_azimuths_deg"].parse(options.head_azimuths_deg),
        inertia_ratio=options.inertia_ratio,
        jitter_us=options.jitter_us,
    )
    for reason in conflicts(values):
        raise ParameterError(reason)
    return values


def _record(options: argparse.Namespace, values: Values) -> SlitRecord:
    azimuths = head_azimuths(values)
    return read_record(slit_measurement.parameters(values), read_slit_file(options.file, len(azimuths)), azimuths)


def _windows(options: argparse.Namespace, values: Values, record: SlitRecord) -> dict[str, Coning | None]:
    time = record.passages.time
    spans = [_span(text) for text in options.window] or [(float(time[0]), math.nextafter(float(time[-1]), math.inf))]
    inclination = slit_inclination(values)
    return {
        f"{start:.2f} to {end:.2f} s": analyse_coning(
            record.passages.between(start, end), inclination, options.inertia_ratio
        )
        for start, end in spans
    }


def _span(text: str) -> tuple[float, float]:
    start, _, end = text.partition(":")
    try:
        span = float(start), float(end)
    except ValueError:
        span = math.nan, math.nan
    if not (span[0] < span[1] and all(map(math.isfinite, span))):
        raise ParameterError(f"--window: {text!r} given, expected START:END in seconds, such as 69.2:188")
    return span


def _refusals(record: SlitRecord) -> str:
    return ", ".join(f"{count} x {REASONS[reason]}" for reason, count in sorted(record.refused.items())) or "none"


def _result_object(record: SlitRecord, windows: dict[str, Coning | None]) -> dict[str, Any]:
    rate, angle = record.passages.rate / (2.0 * np.pi), np.degrees(record.passages.angle)
    return {
        "pulses": record.pulses,
        "passages": len(rate),
        "refused": {REASONS[reason]: count for reason, count in sorted(record.refused.items())},
        "rotation_rate_hz": _spread(rate),
        "sun_angle_deg": _spread(angle),
        "windows": [_window_object(name, coning) for name, coning in windows.items()],
    }


def _spread(values: np.ndarray) -> dict[str, float]:
    return {"mean": float(values.mean()), "min": float(values.min()), "max": float(values.max())}


def _window_object(name: str, coning: Coning | None) -> dict[str, Any]:
    if coning is None:
        return {"window": name, "coning": None}
    return {
        "window": name,
        "coning": {
            "start_s": coning.start,
            "end_s": coning.end,
            "passages": coning.samples,
            "spin_hz": coning.spin,
            "full_angle_deg": math.degrees(coning.full_angle),
            "sinusoid_angle_deg": math.degrees(coning.sine.full_angle),
            "max_min_angle_deg": math.degrees(coning.max_min_angle),
            "period_s": 1.0 / coning.frequency,
            "period_resolution_s": coning.resolution,
            "candidates": [
                {
                    "frequency_hz": candidate.frequency,
                    "period_s": 1.0 / candidate.frequency,
                    "fft_period_s": 1.0 / float(candidate.sequence_frequency),
                    "power": candidate.power,
                    "inertia_ratio": candidate.inertia_ratio,
                    "pulses_missed_by_s": None if residual < 0.0 else residual,
                }
                for candidate, residual in zip(coning.candidates, coning.residuals, strict=True)
            ],
            "chosen": coning.chosen,
            "rivals": list(coning.rivals),
            "because": justification(coning),
        },
    }


def _print(
    console: Console, options: argparse.Namespace, record: SlitRecord, windows: dict[str, Coning | None]
) -> None:
    passages = record.passages
    rate, angle = passages.rate / (2.0 * np.pi), np.degrees(passages.angle)
    console.print(
        f"{options.file}: {record.pulses} pulses, {len(rate)} passages, {passages.time[0]:.2f} to "
        f"{passages.time[-1]:.2f} s of the timer",
        soft_wrap=True,
    )
    console.print(f"refused: {_refusals(record)}", soft_wrap=True)
    console.print(f"rotation rate: mean {rate.mean():.4f} Hz, {rate.min():.4f} to {rate.max():.4f}")
    console.print(f"Sun angle: mean {angle.mean():.2f} deg, {angle.min():.2f} to {angle.max():.2f}")
    for name, coning in windows.items():
        console.print()
        if coning is None:
            console.print(f"coning, {name}: too few passages")
            continue
        console.print(
            f"coning, {name}: full angle {math.degrees(coning.full_angle):.2f} deg by the motion fitted to the pulses, "
            f"{math.degrees(coning.sine.full_angle):.2f} by a sinusoid through the Sun angles, "
            f"{math.degrees(coning.max_min_angle):.2f} by maxima and minima",
            soft_wrap=True,
        )
        console.print(_candidate_table(coning))
        console.print(f"period {1.0 / coning.frequency:.4f} s: {justification(coning)}", soft_wrap=True)


def _candidate_table(coning: Coning) -> ReadableTable:
    table = ReadableTable()
    table.add_name()
    for heading in (
        "frequency\n[Hz]",
        "period\n[s]",
        "FFT\nperiod\n[s]",
        "inertia\nratio",
        "power",
        "pulses\nmissed\nby [us]",
    ):
        table.add_number(heading)
    for i, (candidate, residual) in enumerate(zip(coning.candidates, coning.residuals, strict=True)):
        table.add_texts(
            [
                "chosen" if i == coning.chosen else "as good" if i in coning.rivals else "",
                f"{candidate.frequency:.4f}",
                f"{1.0 / candidate.frequency:.4f}",
                f"{1.0 / candidate.sequence_frequency:.4f}",
                f"{candidate.inertia_ratio:.3f}",
                f"{candidate.power:.4f}",
                "-" if residual < 0.0 else f"{1e6 * residual:.3g}",
            ]
        )
    return table


def _write_passages(path: Path, record: SlitRecord) -> None:
    p = record.passages
    rows = np.stack((p.time, p.rate / (2.0 * np.pi), np.degrees(p.angle), np.degrees(record.sigma)), 1)
    heading = "time_s,rotation_rate_hz,sun_angle_deg,sun_angle_sigma_deg"
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=heading, comments="")


def _figures(folder: Path | None, record: SlitRecord, windows: dict[str, Coning | None]) -> list[Path]:
    if folder is None:
        return []
    from css_analysis.spin_figures import write_coning_figure, write_rate_figure, write_spectrum_figure  # matplotlib

    folder.mkdir(parents=True, exist_ok=True)
    known = {name: coning for name, coning in windows.items() if coning is not None}
    files = [write_rate_figure(record.passages, folder / "rate_and_sun_angle.png")]
    if known:
        files.append(write_coning_figure(record.passages, known, folder / "coning_angle.png"))
        files.append(write_spectrum_figure(record.passages, known, folder / "spectrum.png"))
    return files
