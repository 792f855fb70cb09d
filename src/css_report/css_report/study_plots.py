# SPDX-License-Identifier: Apache-2.0
"""A study as plots: percentiles over the cases against time, and the cases as histograms with confidence intervals."""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
import pyarrow as pa

from css_analysis.flight_metrics import Windows
from css_analysis.intervals import share_interval
from css_analysis.quantities import quantities
from css_analysis.quantity import Quantity
from css_analysis.study_record import StudyRecord
from css_analysis.study_summary import rows_of
from css_report.blocks import Plot
from css_report.looks import look
from css_report.traces import Trace, band, line

LINKED = "study-time"
_MOST_BANDS = 4  # configurations whose bands are told apart; of more, medians and 95 % are drawn
_BINS = 20
_PATTERNS = ("", "/", "x", ".", "\\", "-", "+", "|")
_POSITIVE_SPREAD = 30.0  # largest over smallest percentile from which an axis is logarithmic
_WORDS = {
    "heading_error_deg": ("Angle of estimated to true Sun", "angle [deg]"),
    "pointing_error_deg": ("Angle of array normal to true Sun", "angle [deg]"),
    "rate_deg_s": ("Body rate", "rate [deg/s]"),
    "rate_knowledge_deg_s": ("Error of the estimated body rate", "rate [deg/s]"),
    "attitude_error_deg": ("Error of the attitude", "angle [deg]"),
    "attitude_sigma_deg": ("Bound of the attitude by its covariance, 1 sigma", "angle [deg]"),
    "gyro_bias_error_deg_s": ("Error of the estimated gyro bias", "rate [deg/s]"),
    "cells_lit": ("Cells that contribute", "cells"),
}


def configuration_label(labels: dict[str, Any]) -> str:
    """A configuration in words."""
    gyro = "gyro" if labels["gyro"] else "no gyro"
    return " ".join(filter(None, (f"{labels['estimator']} ({gyro})", labels["overrides"])))


def percentile_plots(study: StudyRecord) -> Iterator[Plot]:
    """One plot for each quantity that was sampled."""
    configurations = study.manifest["configurations"]
    names = dict.fromkeys(study.percentiles["quantity"].to_pylist())
    for name in names:
        traces: list[Trace] = []
        spread: list[float] = []
        last = 0.0
        scale, unit = _scale(study.percentiles)
        for i, labels in enumerate(configurations):
            rows = rows_of(study.percentiles, quantity=name, **labels)
            if rows.num_rows == 0:
                continue
            columns = {key: rows[key].to_numpy() for key in ("time_s", "p05", "p25", "p50", "p75", "p95")}
            time = columns["time_s"] / scale
            last = max(last, float(time[-1]))
            traces += _curves(configuration_label(labels), time, columns, i, len(configurations))
            spread += [float(np.nanmin(columns["p05"])), float(np.nanmax(columns["p95"]))]
        if not traces:
            continue
        title, y_label = _WORDS.get(name, (name, name))
        yield Plot(
            name, title, traces, unit, y_label,
            x={"range": [0.0, last]} if last > 0.0 else {}, y=_ordinate(spread), linked=LINKED, height=300,
            caption=_CAPTION if len(configurations) <= _MOST_BANDS else _CAPTION_OF_MANY,
        )  # fmt: skip


_CAPTION = "Lines: median over the cases. Bands: 25 to 75 and 5 to 95 % of the cases."
_CAPTION_OF_MANY = "Lines: median over the cases, and without markers the 95th percentile."


def _scale(percentiles: pa.Table) -> tuple[float, str]:
    last = percentiles["time_s"].to_numpy().max(initial=0.0)
    return (60.0, "time [min]") if last > 600.0 else (1.0, "time [s]")


def _ordinate(spread: Sequence[float]) -> dict[str, Any]:
    known = [value for value in spread if np.isfinite(value)]
    if known and min(known) > 0.0 and max(known) / min(known) > _POSITIVE_SPREAD:
        return {"type": "log", "tickformat": "~g", "dtick": 1}
    return {"rangemode": "tozero"}


def _curves(label: str, time: np.ndarray, columns: dict[str, np.ndarray], number: int, count: int) -> list[Trace]:
    of = look(number)
    median = line(f"{label}: median", time, columns["p50"], of)
    if count > _MOST_BANDS:
        return [median, line(f"{label}: 95 %", time, columns["p95"], of.dashed("dot"), width=1.0)]
    return [
        *band(f"{label}: 5 to 95 %", time, columns["p05"], columns["p95"], of.dashed("dot"), "1c"),
        *band(f"{label}: 25 to 75 %", time, columns["p25"], columns["p75"], of.dashed("solid"), "38"),
        median,
    ]


def histogram_plots(study: StudyRecord, windows: Windows) -> Iterator[Plot]:
    """One plot for each quantity of the cases that differs between them."""
    by_column: dict[str, Quantity] = {}
    for quantity in quantities(windows):
        by_column.setdefault(quantity.study_column, quantity)
    for column, quantity in by_column.items():
        if column in study.cases.column_names:
            plot = _histogram(study, column, quantity)
            if plot is not None:
                yield plot


def values_of(study: StudyRecord, labels: dict[str, Any], column: str) -> np.ndarray:
    """(C,) values of a column for the cases of a configuration, NaN for none."""
    return rows_of(study.cases, **labels)[column].cast(pa.float64()).to_numpy()


def _histogram(study: StudyRecord, column: str, quantity: Quantity) -> Plot | None:
    configurations = study.manifest["configurations"]
    values = {configuration_label(labels): values_of(study, labels, column) for labels in configurations}
    known = np.concatenate([v[np.isfinite(v)] for v in values.values()])
    if len(known) < 2 or known.min() == known.max():
        return None
    edges = bin_edges(known, quantity.whole)
    traces, without = [], []
    for i, (label, of_cases) in enumerate(values.items()):
        traces.append(_bars(label, of_cases, edges, i, len(values)))
        missing = int(np.count_nonzero(~np.isfinite(of_cases)))
        if missing:
            without.append(f"{label}: {missing} of {len(of_cases)} cases have no value")
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    return Plot(
        f"cases-{column}", f"{column}{unit}", traces, f"{column}{unit}", "share of the cases [%]",
        y={"rangemode": "tozero"}, height=240, narrow=True,
        caption=". ".join([quantity.description[:1].upper() + quantity.description[1:], *without]) + ".",
    )  # fmt: skip


def bin_edges(known: np.ndarray, whole: bool) -> np.ndarray:
    """Edges of the bins of a histogram of values; of counts each number has its own while they are few."""
    low, high = float(known.min()), float(known.max())
    if whole and high - low < 2 * _BINS:
        return np.arange(low - 0.5, high + 1.0)
    return np.linspace(low, high, min(_BINS, max(int(np.sqrt(len(known))), 4)) + 1)


_interval = cache(share_interval)  # fields of many histograms have the same few counts


def _bars(label: str, values: np.ndarray, edges: np.ndarray, number: int, count: int) -> Trace:
    cases = len(values)
    counts, _ = np.histogram(values[np.isfinite(values)], edges)
    share = 100.0 * counts / max(cases, 1)
    ends = [_interval(int(n), cases) for n in counts]
    # an empty field has an upper end too, but twenty of them would hide the others
    more = [100.0 * (high or 0.0) - s if s > 0.0 else None for (_, high), s in zip(ends, share, strict=True)]
    less = [s - 100.0 * (low or 0.0) for (low, _), s in zip(ends, share, strict=True)]
    of, width = look(number), edges[1:] - edges[:-1]
    pattern = {
        "shape": _PATTERNS[number % len(_PATTERNS)],
        "solidity": 0.3,
        "fillmode": "overlay",
        "fgcolor": "#ffffff",
    }
    return {
        "type": "bar", "name": label, "x": (0.5 * (edges[1:] + edges[:-1])), "y": share,
        "width": 0.9 * width / count, "offset": width * (number / count - 0.475),
        "marker": {"color": of.colour, "pattern": pattern},
        "error_y": {
            "type": "data", "symmetric": False, "array": more, "arrayminus": less, "thickness": 1, "width": 2,
            "color": "#5A5A5A",
        },
    }  # fmt: skip
