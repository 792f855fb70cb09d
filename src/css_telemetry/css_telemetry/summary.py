# SPDX-License-Identifier: Apache-2.0
"""What an import did, for people and for `--json`: kept, repaired, refused, each with the first line number."""

from collections.abc import Iterator, Mapping
from typing import Any

from css_common.epochs import format_utc
from css_telemetry.description import USUAL_VIEW_DEG
from css_telemetry.faults import Counted, counted_objects
from css_telemetry.header import likenesses
from css_telemetry.importing import ImportReport
from css_telemetry.table_text import listed
from css_telemetry.true_states import ATTITUDE, ILLUMINATION, POSITION, RATE, SUN

_PARTS = (SUN, ATTITUDE, RATE, POSITION, ILLUMINATION)
_PLAIN_LOW, _PLAIN_HIGH = 0.5, 1.5  # largest output of a table in which some cell once faces the Sun


def summary_lines(report: ImportReport) -> Iterator[str]:
    """Lines for people."""
    telemetry, account = report.telemetry, report.telemetry.account
    yield f"{report.recording}: {sum(report.messages.values())} messages, every {report.period_s:g} s"
    yield from (f"  {count:9d}  {topic}" for topic, count in report.messages.items())
    span_s = (report.last_ns - report.first_ns) * 1e-9
    yield f"time (UTC): {format_utc(report.first_ns)} to {format_utc(report.last_ns)}, {span_s:g} s"
    yield from _unknown_boot(report)
    yield (
        f"lines of telemetry: {account.lines} read, {len(telemetry.stamps_ns)} used, {account.refused_lines} refused"
        + (f", {account.repaired_values} values left out" if account.repaired else "")
    )
    yield from _counts("refused", account.refused)
    yield from _counts("values left out", account.repaired)
    for what, found in account.missing.items():
        yield f"{what}: {found.times}, the first in line {found.first_line}"
    for value, found in account.fills.items():
        yield (
            f"taken for a missing value of {found.detail}: {value:.10g}, {found.times} times, the first in line "
            f"{found.first_line}"
        )
    if report.gaps:
        yield f"gaps in time: {report.gaps}, the longest {report.longest_gap_s:g} s"
    if telemetry.doubt:
        yield f"a guess: {telemetry.doubt}"
    if telemetry.read_as:
        yield f"read as: {', '.join(telemetry.read_as)}"
    if not telemetry.description.views_known:
        yield f"field of view of the cells: not told, taken for {USUAL_VIEW_DEG:g} deg (field_of_view_deg tells it)"
    yield from _truth_lines(report)
    yield from report.orbit_notes
    if telemetry.sunlight is not None:
        yield "flag of the shadow: heard by estimators with eclipse.source flag (--estimators ekf:eclipse.source=flag)"
    if report.calibration is not None:
        yield f"calibration: {report.calibration}, taken off by whoever replays the recording; its cells are as read"
    if telemetry.ignored_columns:
        yield f"columns not used: {listed(telemetry.ignored_columns)}"
        yield from (f"  {likeness}" for likeness in likenesses(telemetry.ignored_columns))
    largest = telemetry.largest_output
    if not _PLAIN_LOW <= largest <= _PLAIN_HIGH:
        side = "so that no cell ever faces the Sun, or the scale is too large"
        side = side if largest < 1.0 else "more than the Sun can give: the scale is too small"
        yield f"the largest cell output is {largest:.3g}; 1 is the Sun met head-on, {side}; see --full-scale"


def _counts(what: str, counts: Mapping[str, Counted]) -> Iterator[str]:
    for kind, found in counts.items():
        yield f"  {what} ({kind}): {found.times}, the first is line {found.first_line}: {found.detail}"


def _unknown_boot(report: ImportReport) -> Iterator[str]:
    if not report.telemetry.description.dates_known:
        yield "the instant of the boot is not known: dates are not those of the flight (time: epoch tells it)"


def _truth_lines(report: ImportReport) -> Iterator[str]:
    states = report.states
    if states is None:
        yield "truth: none, so that replays have no errors to show"
        return
    unknown = [part for part in _PARTS if part not in states.known]
    where = "of the table" if ATTITUDE in states.known else "of the table, taken to be in the body frame"
    form = report.telemetry.description.truth
    if form is not None and form.sun is None:
        where = "by its direction in the description" if form.sun_inertial is not None else "by the ephemeris"
    yield (
        f"truth: the Sun {where}; known {', '.join(states.known)}"
        + (f"; not known {', '.join(unknown)}" if unknown else "")
    )
    if report.sun is not None:
        yield (
            f"the Sun of the truth is {report.sun.median_deg:.2g} deg (median of {report.sun.lines} lines) from that "
            "of the lit cells"
        )


def summary_object(report: ImportReport) -> dict[str, Any]:
    """What `--json` prints."""
    telemetry, account = report.telemetry, report.telemetry.account
    return {
        "recording": str(report.recording),
        "messages": report.messages,
        "first_utc": format_utc(report.first_ns),
        "last_utc": format_utc(report.last_ns),
        "span_s": (report.last_ns - report.first_ns) * 1e-9,
        "period_s": report.period_s,
        "gaps": report.gaps,
        "longest_gap_s": report.longest_gap_s,
        "lines": {"read": account.lines, "used": len(telemetry.stamps_ns), "refused": account.refused_lines},
        "refused": counted_objects(account.refused),
        "repaired": counted_objects(account.repaired),
        "missing": counted_objects(account.missing),
        "fill_values": [
            {"value": value, "of": found.detail, "count": found.times, "first_line": found.first_line}
            for value, found in account.fills.items()
        ],
        "read_as": list(telemetry.read_as),
        "guessed_form": telemetry.doubt,
        "columns_not_used": list(telemetry.ignored_columns),
        "largest_output": telemetry.largest_output,
        "truth": list(report.states.known) if report.states is not None else [],
        "sun_against_cells_deg": report.sun.median_deg if report.sun is not None else None,
        "dates_known": telemetry.description.dates_known,
        "field_of_view_deg": telemetry.description.field_of_view_deg,
        "orbit": report.orbit or None,
        "calibration": None if report.calibration is None else str(report.calibration),
        "notes": report.orbit_notes,
    }
