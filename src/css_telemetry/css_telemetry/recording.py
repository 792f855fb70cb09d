# SPDX-License-Identifier: Apache-2.0
"""Writes telemetry into a recording that replays like one of Sunpoint's own.

Topics: `css/voltages`; `gyro/imu`, `mag/field`, `wheels/state`, `css/temperature` (further ones on `temperature/NAME`)
where the table has them; `sunlight/illuminance` by a flag of the shadow that is aiding; `truth` where it has the Sun
vector or the attitude. The mission inside holds what the description tells of the spacecraft and its orbit, what a
calibration tells of its sensors, and nothing else.
"""

import json
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from sensor_msgs.msg import Illuminance, Imu, MagneticField, Temperature

from css_common.codec import codec_of
from css_common.epochs import format_utc
from css_common.mission_file import dump_sections
from css_common.mission_section import name_for_files
from css_common.progress_lines import ProgressLines
from css_common.sensor_inputs import FULL_SUN_LUX
from css_msgs.msg import CssVoltages, SpacecraftState, WheelState
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter
from css_recording.provenance import IMPORTED_FROM, software_versions
from css_telemetry.description import USUAL_VIEW_DEG
from css_telemetry.telemetry import Telemetry
from css_telemetry.true_states import TrueStates

BODY_FRAME = "bus"
INERTIAL_FRAME = "eci"
VOLTAGES = Topic("/css/voltages", "css_msgs/msg/CssVoltages")
IMU = Topic("/gyro/imu", "sensor_msgs/msg/Imu")
FIELD = Topic("/mag/field", "sensor_msgs/msg/MagneticField")
WHEELS = Topic("/wheels/state", "css_msgs/msg/WheelState")
SUNLIGHT = Topic("/sunlight/illuminance", "sensor_msgs/msg/Illuminance")
TEMPERATURE = "/css/temperature"
TRUTH = Topic("/truth", "css_msgs/msg/SpacecraftState")
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 0.001, 60.0
_LARGEST_GAP_S = 60.0
_NO_ESTIMATE = -1.0  # first element of a covariance: the quantity is not measured


def write_recording(
    telemetry: Telemetry,
    states: TrueStates | None,
    mission: str,
    source: Path,
    folder: Path,
    *,
    overwrite: bool = False,
) -> dict[str, int]:
    """Writes telemetry into a new recording; messages of each topic.

    Args:
        telemetry: what was read of `source`.
        states: its truth.
        mission: text of the mission that it holds.
        source: file it came from, kept by name and hash.
        folder: the recording.
        overwrite: replace a recording that is there.

    Raises:
        BagError: the recording cannot be written.
    """
    # topics of one stamp stand in this order: what stands until it is told anew, then the readings that it is for
    topics = [SUNLIGHT] * (telemetry.sunlight is not None) + [*_temperature_topics(telemetry).values()]
    topics += [TRUTH] * (states is not None) + [VOLTAGES] + [IMU] * (telemetry.rate is not None)
    topics += [FIELD] * (telemetry.field is not None) + [WHEELS] * (telemetry.wheels is not None)
    origin = {"file": source.name, "sha256": telemetry.sha256, "truth": list(states.known) if states else []}
    metadata = {
        "mission": mission,
        IMPORTED_FROM: json.dumps(origin),
        **software_versions(),
    }
    progress = ProgressLines(f"writing {folder}", "lines of telemetry")
    count = len(telemetry.stamps_ns)
    begun = False
    try:
        with BagWriter(folder, topics, metadata, overwrite=overwrite) as writer:
            begun = True
            place = {int(row): k for k, row in enumerate(states.rows)} if states is not None else {}
            blind = telemetry.blind
            for row in range(count):
                stamp_ns = int(telemetry.stamps_ns[row])
                if states is not None and row in place:
                    writer.write(TRUTH.name, stamp_ns, _truth(states, place[row], stamp_ns))
                for topic, data in _measured(telemetry, row, stamp_ns, bool(blind[row])):
                    writer.write(topic.name, stamp_ns, data)
                if row % 1000 == 0:
                    progress.tell(row, count)
            return writer.counts
    except KeyboardInterrupt:
        if begun:  # closed as it is, a part of the table would pass for all of it
            shutil.rmtree(folder, ignore_errors=True)
        raise


def mission_text(
    telemetry: Telemetry, orbit: Mapping[str, Any], name: str, period_s: float, largest_step_s: float
) -> str:
    """Mission file for replaying the telemetry; what it does not know keeps its default, which is nobody's.

    Args:
        telemetry: what was read.
        orbit: entries of the section `orbit` of the mission; empty: it is not known.
        name: of the mission.
        period_s, largest_step_s: usual and largest step of time.
    """
    description, stamps = telemetry.description, telemetry.stamps_ns
    period_s = min(max(period_s, SHORTEST_PERIOD_S), LONGEST_PERIOD_S)
    entries: dict[str, Any] = {
        "mission.name": name_for_files(name),
        "mission.description": "imported telemetry",
        "mission.epoch": format_utc(int(stamps[0])),
        "mission.duration": max(float(stamps[-1] - stamps[0]) * 1e-9, period_s),
        "mission.period": period_s,
        **{f"orbit.{key}": value for key, value in orbit.items()},
        "cells.normals": [component for cell in description.cells for component in cell.normal_b],
        "cells.field_of_view_deg": description.field_of_view_deg or USUAL_VIEW_DEG,
        "cells.clip_normal": list(description.clip_normal_b),
        "io.body_frame": BODY_FRAME,
        "io.inertial_frame": INERTIAL_FRAME,
        "io.largest_gap": max(_LARGEST_GAP_S, 2.0 * largest_step_s),
    }
    if any(cell.field_of_view_deg is not None for cell in description.cells):
        usual = description.field_of_view_deg or USUAL_VIEW_DEG
        entries["cells.fields_of_view_deg"] = [cell.field_of_view_deg or usual for cell in description.cells]
    if description.inertia:
        entries["spacecraft.inertia"] = list(description.inertia)
    wheels = description.aiding.wheels if description.aiding is not None else None
    if wheels is not None:
        entries["wheels.axes"] = [component for axis in wheels.axes_b for component in axis]
        if wheels.inertia is not None:
            entries["wheels.inertia"] = wheels.inertia
    return dump_sections({"/**": entries})


def _temperature_topics(telemetry: Telemetry) -> dict[str, Topic]:
    """Topic of each column: the first is that of the cells."""
    topics: dict[str, Topic] = {}
    for number, name in enumerate(telemetry.temperatures):
        topic = f"/temperature/{_ros_name(name)}" if number else TEMPERATURE
        if any(known.name == topic for known in topics.values()):
            topic = f"{topic}_{number}"
        topics[name] = Topic(topic, "sensor_msgs/msg/Temperature")
    return topics


def _ros_name(name: str) -> str:
    """A name of a column as part of a topic's name."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed"
    return plain if plain[0].isalpha() else f"c{plain}"


def _truth(states: TrueStates, k: int, stamp_ns: int) -> bytes:
    codec = codec_of(SpacecraftState)
    truth = codec.sample(
        stamp_ns,
        INERTIAL_FRAME,
        r_n=states.r_n[k],
        v_n=states.v_n[k],
        sigma_bn=states.sigma_bn[k],
        omega_bn_b=states.omega_bn_b[k],
        sun_n=states.sun_n[k],
    )
    truth.solar_flux, truth.illumination = float(states.flux[k]), float(states.illumination[k])
    return codec.encode(truth)


def _measured(telemetry: Telemetry, row: int, stamp_ns: int, blind: bool) -> Iterator[tuple[Topic, bytes]]:
    if telemetry.sunlight is not None and np.isfinite(telemetry.sunlight[row]):
        codec = codec_of(Illuminance)
        lux = FULL_SUN_LUX * float(telemetry.sunlight[row])
        yield SUNLIGHT, codec.encode(codec.sample(stamp_ns, BODY_FRAME, illuminance=lux))
    for name, topic in _temperature_topics(telemetry).items() if telemetry.temperatures else ():
        values = telemetry.temperatures[name]
        if np.isfinite(values[row]):
            codec = codec_of(Temperature)
            yield (
                topic,
                codec.encode(codec.sample(stamp_ns, BODY_FRAME, temperature=float(values[row]))),
            )
    if not blind:
        codec = codec_of(CssVoltages)
        yield VOLTAGES, codec.encode(codec.sample(stamp_ns, BODY_FRAME, voltages=telemetry.cells[row]))
    if telemetry.rate is not None:
        yield IMU, _imu(telemetry.rate[row], stamp_ns)
    if telemetry.field is not None:
        yield FIELD, _field(telemetry.field[row], stamp_ns)
    if telemetry.wheels is not None and np.isfinite(telemetry.wheels[row]).all():
        codec = codec_of(WheelState)
        speed = telemetry.wheels[row]
        yield WHEELS, codec.encode(codec.sample(stamp_ns, BODY_FRAME, speed=speed, torque=np.zeros(len(speed))))


def _imu(rate: np.ndarray, stamp_ns: int) -> bytes:
    codec, unknown, measured = codec_of(Imu), _unknown(), bool(np.isfinite(rate).all())
    return codec.encode(
        codec.sample(
            stamp_ns,
            BODY_FRAME,
            orientation=np.array([0.0, 0.0, 0.0, 1.0]),
            orientation_covariance=unknown,
            angular_velocity=rate if measured else np.zeros(3),
            angular_velocity_covariance=np.zeros(9) if measured else unknown,
            linear_acceleration_covariance=unknown,
        )
    )


def _field(field: np.ndarray, stamp_ns: int) -> bytes:
    codec, measured = codec_of(MagneticField), bool(np.isfinite(field).all())
    return codec.encode(
        codec.sample(
            stamp_ns,
            BODY_FRAME,
            magnetic_field=field if measured else np.zeros(3),
            magnetic_field_covariance=np.zeros(9) if measured else _unknown(),
        )
    )


def _unknown() -> np.ndarray:
    covariance = np.zeros(9)
    covariance[0] = _NO_ESTIMATE
    return covariance
