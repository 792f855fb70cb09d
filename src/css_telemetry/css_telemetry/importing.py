# SPDX-License-Identifier: Apache-2.0
"""From a table of telemetry to a recording: reads by a description, fits the orbit, writes, and tells what it did."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from css_common.component import Finding
from css_common.epochs import format_utc
from css_common.mission import mission_from_text
from css_common.progress_lines import ProgressLines
from css_environment.orbit import TleOrbit
from css_environment.tle_checks import tle_findings
from css_recording.bag_folder import fresh_folder
from css_recording.errors import BagError
from css_sensors.calibrated_readings import calibration_sections
from css_telemetry.description import Description
from css_telemetry.description_file import read_description
from css_telemetry.orbit_arcs import FAR_S, Arcs, fit_arcs
from css_telemetry.recording import LONGEST_PERIOD_S, mission_text, write_recording
from css_telemetry.sun_check import SunCheck, sun_check
from css_telemetry.telemetry import Telemetry, read_telemetry, refuse_unscaled
from css_telemetry.true_states import TrueStates, true_states

_MOST_NAMED = 3  # stretches of time that are named


@dataclass
class ImportReport:
    """What an import made.

    Attributes:
        recording: the new recording.
        telemetry: what was read.
        states: its truth.
        messages: messages of each topic.
        period_s: usual step of time.
        gaps: steps of time longer than one and a half periods.
        longest_gap_s: the longest step of time.
        orbit: entries of the section `orbit` of its mission; empty: it has none.
        orbit_notes: where the orbit comes from, or why there is none, one line each.
        sun: how the Sun of the truth fits the bright cells; None: too few lines tell.
        calibration: file of what is known of the sensors, which the mission of the recording holds; None: none.
    """

    recording: Path
    telemetry: Telemetry
    states: TrueStates | None = None
    messages: dict[str, int] = field(default_factory=dict)
    period_s: float = 0.0
    gaps: int = 0
    longest_gap_s: float = 0.0
    orbit: dict[str, Any] = field(default_factory=dict)
    orbit_notes: list[str] = field(default_factory=list)
    sun: SunCheck | None = None
    calibration: Path | None = None

    @property
    def first_ns(self) -> int:
        """First instant [ns of UTC since 1970]."""
        return int(self.telemetry.stamps_ns[0])

    @property
    def last_ns(self) -> int:
        """Last instant [ns of UTC since 1970]."""
        return int(self.telemetry.stamps_ns[-1])


def import_table(
    table: str | Path,
    description: str | Path | Description,
    folder: str | Path | None = None,
    *,
    overwrite: bool = False,
    epoch_ns: int | None = None,
    full_scale: float | None = None,
    time_unit: str | None = None,
    calibration: str | Path | None = None,
) -> ImportReport:
    """Turns a table of telemetry into a recording that replays like one of Sunpoint's own.

    Args:
        table: CSV or any other separated text, Parquet or Excel.
        description: which column is what: a file, or what `read_description` gives.
        folder: the recording; None: `bags/NAME_TIME`.
        overwrite: replace a recording that is there.
        epoch_ns: instant [ns since 1970] from which counts of time count, above that of the description.
        full_scale: what the Sun, met head-on, adds to a cell's dark level, above that of the description.
        time_unit: of counts of time (s, ms, us, ns, min, h, d), above that of the description.
        calibration: file of `calibrate` about these sensors, for the mission of the recording.

    Returns:
        What was made, and what became of every line: `ImportReport.telemetry.account`.

    Raises:
        BagError: table or description are wrong, or the recording cannot be written; one line that says where, what,
            and what would be right.
        MissionError: the calibration is none of these cells.
    """
    source = Path(table)
    if not isinstance(description, Description):
        description = read_description(Path(description))
    telemetry = read_telemetry(source, description, epoch_ns=epoch_ns, full_scale=full_scale, time_unit=time_unit)
    refuse_unscaled(telemetry, source)
    folder = Path(folder) if folder is not None else fresh_folder(source.stem)
    report = examined(telemetry, folder, None if calibration is None else Path(calibration))
    record(report, source, overwrite=overwrite)
    return report


def record(report: ImportReport, source: Path, *, overwrite: bool = False) -> None:
    """Writes the recording of a report, and counts its messages there.

    Args:
        report: what `examined` gave.
        source: the table, kept by name and hash.
        overwrite: replace a recording that is there.

    Raises:
        BagError: the recording cannot be written.
    """
    report.messages = write_recording(
        report.telemetry,
        report.states,
        _mission_text(report, source.stem),
        source,
        report.recording,
        overwrite=overwrite,
    )


def _mission_text(report: ImportReport, name: str) -> str:
    """The mission of the recording.

    Raises:
        MissionError: a calibration is none of its cells.
    """
    text = mission_text(report.telemetry, report.orbit, name, report.period_s, report.longest_gap_s)
    if report.calibration is None:
        return text
    mission = mission_from_text(text, str(report.calibration)).with_sections(calibration_sections(report.calibration))
    _ = mission.values  # read as a whole, so that what does not fit is refused here
    return mission.text()


def examined(telemetry: Telemetry, folder: Path, calibration: Path | None = None) -> ImportReport:
    """What a table tells about itself, before anything is written into `folder`.

    Raises:
        BagError: the element set of its description does not hold for its time, or the ephemeris needs dates that
            it has not.
        MissionError: the calibration cannot be read, or is none of these cells.
    """
    steps = np.diff(telemetry.stamps_ns) * 1e-9
    period_s = round(float(np.median(steps)), 6) if len(steps) else LONGEST_PERIOD_S
    _refuse_ephemeris_without_date(telemetry)
    states = true_states(telemetry)
    report = ImportReport(
        folder,
        telemetry,
        states,
        period_s=period_s,
        gaps=int(np.sum(steps > 1.5 * period_s)),
        longest_gap_s=float(np.max(steps)) if len(steps) else 0.0,
        sun=None if states is None else sun_check(telemetry, states),
        calibration=calibration,
    )
    _find_orbit(report)
    if calibration is not None:
        _mission_text(report, folder.name)
    return report


def _refuse_ephemeris_without_date(telemetry: Telemetry) -> None:
    truth = telemetry.description.truth
    if truth is None or truth.attitude is None or telemetry.description.dates_known:
        return
    if truth.sun is None and truth.sun_inertial is None:
        raise BagError(
            "the description: truth.attitude: given without a Sun, and times count from a boot that nobody dated, "
            "expected time.epoch, truth.sun or truth.sun_inertial"
        )


def _find_orbit(report: ImportReport) -> None:
    """The orbit by which estimators will know their place; none is made up."""
    telemetry = report.telemetry
    aiding = telemetry.description.aiding
    form = aiding.position if aiding is not None else None
    if form is not None and not telemetry.description.dates_known:
        report.orbit_notes.append("orbit: none, for the instant of the boot is not known: time: epoch tells it")
        return
    if form is None:
        report.orbit_notes.append("orbit: none given, so that estimators that need one ask for it")
        return
    if form.tle is not None:
        report.orbit_notes += [f"orbit: {finding.text}" for finding in _of_set(form.tle, report)]
        report.orbit = {"source": "tle", "tle_line1": form.tle[0], "tle_line2": form.tle[1]}
        report.orbit_notes.insert(0, "orbit: by the two-line element set of the description")
        return
    assert telemetry.place is not None
    progress = ProgressLines("fitting the orbit to positions", "days")
    try:
        found = fit_arcs(telemetry.place, telemetry.stamps_ns, progress.tell)
    except ValueError as error:
        report.orbit_notes.append(f"orbit: none, positions are not used: {error}")
        return
    first, *later = found.arcs
    report.orbit = {"source": "elements", "model": "j2_integrated", **first.elements._asdict()}
    if later:
        report.orbit["later_elements"] = [number for arc in later for number in (arc.start_s, *arc.elements)]
    report.orbit_notes += _about_arcs(found, report)


def _about_arcs(found: Arcs, report: ImportReport) -> Iterator[str]:
    """What came of the positions, a line each."""
    arcs, first_ns = found.arcs, report.first_ns

    def utc(elapsed_s: float) -> str:
        return format_utc(first_ns + round(elapsed_s * 1e9))

    rms = math.sqrt(sum(arc.rms_m**2 for arc in arcs) / len(arcs))
    sets = "elements" if len(arcs) == 1 else f"{len(arcs)} sets of elements, one after the other,"
    yield (
        f"orbit: {sets} fitted to the positions, which are {rms:.3g} m (rms) from it, at most "
        f"{max(arc.worst_m for arc in arcs):.3g} m"
    )
    for begin_s, end_s in found.lost_s[:_MOST_NAMED]:
        yield f"orbit: the positions from {utc(begin_s)} to {utc(end_s)} follow no orbit; the elements before go on"
    if len(found.lost_s) > _MOST_NAMED:
        yield f"orbit: so do those of {len(found.lost_s) - _MOST_NAMED} more stretches"
    far = [(a.end_s, b.start_s) for a, b in pairwise(arcs) if b.start_s - a.end_s > FAR_S]
    end_s = (report.last_ns - first_ns) * 1e-9
    far += [(arcs[-1].end_s, end_s)] if end_s - arcs[-1].end_s > FAR_S else []
    for begin_s, until_s in far[:_MOST_NAMED]:
        yield f"orbit: no positions from {utc(begin_s)} to {utc(until_s)}: the place there is extrapolated, a guess"


def _of_set(lines: tuple[str, str], report: ImportReport) -> list[Finding]:
    duration_s = math.ceil((report.last_ns - report.first_ns) * 1e-9)
    findings = list(tle_findings(TleOrbit(*lines), report.first_ns, max(duration_s, 1.0)))
    refused = [finding for finding in findings if finding.refused]
    if refused:
        raise BagError(f"the description: aiding.position.tle: {refused[0].text}")
    return findings
