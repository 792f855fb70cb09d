# SPDX-License-Identifier: Apache-2.0
"""Turns a table of foreign telemetry into a recording that replays like one of Sunpoint's own.

Topics: `css/voltages`, `gyro/imu` where the table has rates, and `truth` where it has the Sun vector. The mission
inside carries the cell layout, the epoch and the period, so that estimators find what they need.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np
from sensor_msgs.msg import Imu

from css_common.codec import codec_of
from css_common.epochs import format_utc
from css_common.mission_file import dump_sections
from css_common.sections import name_for_files
from css_msgs.msg import CssVoltages, SpacecraftState
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter
from css_recording.errors import BagError
from css_telemetry.layout_file import CellLayout
from css_recording.provenance import software_versions
from css_telemetry.telemetry_table import Telemetry, TelemetryRow

BODY_FRAME = "bus"
INERTIAL_FRAME = "eci"
VOLTAGES = Topic("/css/voltages", "css_msgs/msg/CssVoltages")
IMU = Topic("/gyro/imu", "sensor_msgs/msg/Imu")
TRUTH = Topic("/truth", "css_msgs/msg/SpacecraftState")
_SHORTEST_PERIOD_S, _LONGEST_PERIOD_S = 0.001, 60.0
_LARGEST_GAP_S = 60.0
_LEAST_PLAUSIBLE, _MOST_PLAUSIBLE = 0.1, 3.0  # largest output of any cell that is in units of full Sun
_NO_ESTIMATE = -1.0  # first element of a covariance: the quantity is not measured


@dataclass
class ImportReport:
    """What an import made.

    Attributes:
        recording: the new recording.
        telemetry: what was read.
        messages: messages of each topic.
        missing_cells: single cell outputs that were missing; they are NaN in the recording.
        missing_lines: lines without any cell output, which give no message.
        missing_rates: lines without a rate, recorded as a gyro that does not measure.
        missing_suns: lines without a Sun vector, which give no truth.
        gaps: steps of time longer than one and a half periods.
        longest_gap_s: the longest step of time.
        period_s: usual step of time.
        largest_output: of any cell, after scaling.
    """

    recording: Path
    telemetry: Telemetry
    messages: dict[str, int] = field(default_factory=dict)
    missing_cells: int = 0
    missing_lines: int = 0
    missing_rates: int = 0
    missing_suns: int = 0
    gaps: int = 0
    longest_gap_s: float = 0.0
    period_s: float = 0.0
    largest_output: float = 0.0


def import_telemetry(
    telemetry: Telemetry, layout: CellLayout, source: Path, folder: Path, *, overwrite: bool = False
) -> ImportReport:
    """Writes telemetry into a new recording.

    Args:
        telemetry: what `read_telemetry` gave for `source`.
        layout: cells of the spacecraft.
        source: file it came from, kept by name and hash.
        folder: the recording.
        overwrite: replace a recording that is there.

    Raises:
        BagError: the recording cannot be written.
    """
    report = _examined(telemetry, folder)
    topics = [TRUTH] * telemetry.has_sun + [VOLTAGES] + [IMU] * telemetry.has_rate
    metadata = {
        "mission": mission_text(telemetry, layout, source.stem, report.period_s, report.longest_gap_s),
        "imported_from": json.dumps({"file": source.name, "sha256": telemetry.sha256}),
        **software_versions(),
    }
    with BagWriter(folder, topics, metadata, overwrite=overwrite) as writer:
        for row in telemetry.rows:
            for topic, data in _messages(row, telemetry.has_rate):
                writer.write(topic.name, row.stamp_ns, data)
        report.messages = writer.counts
    return report


def mission_text(telemetry: Telemetry, layout: CellLayout, name: str, period_s: float, largest_step_s: float) -> str:
    """Mission file for replaying the telemetry; everything that it does not know keeps its default."""
    rows = telemetry.rows
    period_s = min(max(period_s, _SHORTEST_PERIOD_S), _LONGEST_PERIOD_S)
    return dump_sections(
        {
            "/**": {
                "mission.name": name_for_files(name),
                "mission.description": "imported telemetry",
                "mission.epoch": format_utc(rows[0].stamp_ns),
                "mission.duration": max((rows[-1].stamp_ns - rows[0].stamp_ns) * 1e-9, period_s),
                "mission.period": period_s,
                "cells.normals": [component for normal in layout.normals_b for component in normal],
                "cells.field_of_view_deg": layout.field_of_view_deg,
                "cells.clip_normal": list(layout.clip_normal_b),
                "io.body_frame": BODY_FRAME,
                "io.inertial_frame": INERTIAL_FRAME,
                "io.largest_gap": max(_LARGEST_GAP_S, 2.0 * largest_step_s),
            }
        }
    )


def largest_output(telemetry: Telemetry) -> float:
    """The largest output of any cell; NaN when all are missing."""
    return max((value for row in telemetry.rows for value in row.cells if not math.isnan(value)), default=math.nan)


def refuse_unscaled(telemetry: Telemetry, source: Path) -> None:
    """Refuses a table without cell outputs, and one that is plainly in another unit while no full scale was stated.

    Raises:
        BagError: naming the largest output and what would be right.
    """
    largest = largest_output(telemetry)
    if math.isnan(largest):
        raise BagError(f"{source}: every cell output is missing")
    if not telemetry.scaled and not _LEAST_PLAUSIBLE <= largest <= _MOST_PLAUSIBLE:
        raise BagError(
            f"{source}: the largest cell output is {largest:.3g}, expected about 1, which is a cell that the Sun meets "
            "head-on: say what such a cell reads by --full-scale or by full_scale in the layout, and what it reads in "
            "the dark by dark_level there; --full-scale 1 takes the outputs as they are"
        )


def _examined(telemetry: Telemetry, folder: Path) -> ImportReport:
    """What the table tells about itself."""
    rows = telemetry.rows
    steps = [(b.stamp_ns - a.stamp_ns) * 1e-9 for a, b in pairwise(rows)]
    period_s = round(median(steps), 6) if steps else _LONGEST_PERIOD_S
    return ImportReport(
        folder,
        telemetry,
        missing_cells=sum(math.isnan(value) for row in rows if not _is_blind(row) for value in row.cells),
        missing_lines=sum(map(_is_blind, rows)),
        missing_rates=sum(row.omega_bn_b is None for row in rows) if telemetry.has_rate else 0,
        missing_suns=sum(row.sun_b is None for row in rows) if telemetry.has_sun else 0,
        gaps=sum(step > 1.5 * period_s for step in steps),
        longest_gap_s=max(steps, default=0.0),
        period_s=period_s,
        largest_output=largest_output(telemetry),
    )


def _is_blind(row: TelemetryRow) -> bool:
    return all(math.isnan(value) for value in row.cells)


def _messages(row: TelemetryRow, has_rate: bool) -> Iterator[tuple[Topic, bytes]]:
    rate = np.zeros(3) if row.omega_bn_b is None else np.array(row.omega_bn_b)
    if row.sun_b is not None:
        # The attitude is not known: body and inertial frame are taken for one, so that the Sun direction in the
        # body is the one of the table. Position, velocity and field are not known either: a zero r_n says so.
        codec = codec_of(SpacecraftState)
        truth = codec.sample(row.stamp_ns, INERTIAL_FRAME, sun_n=np.array(row.sun_b), omega_bn_b=rate)
        truth.solar_flux = truth.illumination = 1.0
        yield TRUTH, codec.encode(truth)
    if not _is_blind(row):
        codec = codec_of(CssVoltages)
        yield VOLTAGES, codec.encode(codec.sample(row.stamp_ns, BODY_FRAME, voltages=np.array(row.cells)))
    if has_rate:
        codec = codec_of(Imu)
        unknown = np.zeros(9)
        unknown[0] = _NO_ESTIMATE
        sample = codec.sample(
            row.stamp_ns,
            BODY_FRAME,
            orientation=np.array([0.0, 0.0, 0.0, 1.0]),
            orientation_covariance=unknown,
            angular_velocity=rate,
            angular_velocity_covariance=unknown if row.omega_bn_b is None else np.zeros(9),
            linear_acceleration_covariance=unknown,
        )
        yield IMU, codec.encode(sample)
