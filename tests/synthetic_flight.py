# SPDX-License-Identifier: Apache-2.0
"""Made-up flights whose every angle is known, as columns and as recordings."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from css_analysis.flight_log import FlightLog
from css_common.codec import codec_of
from css_common.epochs import parse_utc
from css_common.message_columns import Columns
from css_msgs.msg import SpacecraftState, SunEstimate
from css_recording.bag_metadata import Topic
from css_recording.bag_writer import BagWriter

EPOCH_NS = parse_utc("2013-06-01T00:00:00Z")
DT = 0.1


def stamps(steps: int, period: float = DT) -> np.ndarray:
    """(steps,) stamps [ns] from the epoch on."""
    return EPOCH_NS + np.arange(steps) * round(period * 1e9)


def columns(message_type: type, stamp_ns: np.ndarray, **given: Any) -> Columns:
    """Columns with zeros in the fields that are not given; a single row is repeated."""
    fields = {}
    for field in codec_of(message_type).fields:
        shape = (len(stamp_ns),) if field.count is None else (len(stamp_ns), field.count or 8)
        value = np.zeros(shape, field.dtype)
        value[...] = given.pop(field.name, 0)
        fields[field.name] = value
    assert not given, given
    return Columns(stamp_ns, **fields)


def tilted(angle_deg: ArrayLike, azimuth: float = 0.0) -> np.ndarray:
    """(M, 3) unit vectors at given angles from +z."""
    a = np.radians(np.asarray(angle_deg, dtype=np.float64))
    return np.column_stack([np.sin(a) * np.cos(azimuth), np.sin(a) * np.sin(azimuth), np.cos(a)])


def truth(pointing_deg: np.ndarray, illumination: np.ndarray | float = 1.0, **given: Any) -> Columns:
    """Truth with the Sun at given angles from the array normal +z: frames b and n agree."""
    given = {"sun_n": tilted(pointing_deg), "illumination": illumination, "solar_flux": 1.0} | given
    return columns(SpacecraftState, stamps(len(pointing_deg)), **given)


def estimates(sun_b: np.ndarray, **given: Any) -> Columns:
    """Valid estimates at every step."""
    return columns(SunEstimate, stamps(len(sun_b)), **({"sun_b": sun_b, "validity": 2} | given))


def flight(pointing_deg: np.ndarray, illumination: np.ndarray | float = 1.0, **estimated: Columns) -> FlightLog:
    """A flight with a truth and some estimators."""
    return FlightLog("made up", truth=truth(pointing_deg, illumination), estimates=estimated)


def record(folder: Path, topics: Mapping[str, tuple[type, Columns]], mission: str = "", frame: str = "bus") -> Path:
    """A recording of columns, topic to type and columns."""
    metadata = {"mission": mission} if mission else None
    declared = [Topic(name, codec_of(kind).type_name) for name, (kind, _) in topics.items()]
    with BagWriter(folder, declared, metadata) as writer:
        for name, (kind, messages) in topics.items():
            codec = codec_of(kind)
            names = [field.name for field in codec.fields]
            for i, stamp_ns in enumerate(messages.stamp_ns):
                row = {field: getattr(messages, field)[i] for field in names}
                sample = codec.sample(int(stamp_ns), frame, **row)
                writer.write(name, int(stamp_ns), codec.encode(sample))
    return folder
