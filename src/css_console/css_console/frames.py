# SPDX-License-Identifier: Apache-2.0
"""One instant of a flight as the page shows it, from the last messages of its topics."""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from css_analysis.estimate_errors import heading_sigma_of
from css_analysis.flight_series import MODES, RPM
from css_analysis.flight_topics import SINGLE, estimator_of
from css_common.attitude import dcm_to_quaternion, mrp_to_dcm
from css_common.codec import Sample
from css_common.earth import EARTH_RADIUS
from css_common.epochs import format_utc
from css_common.health_words import EVIDENCE_WORDS, KIND_WORDS, unit_name
from css_common.vectors import angle_between, multiply, norm, scale, unit, vector_of
from css_msgs.msg import (
    AttitudeEstimate,
    ControlStatus,
    CssVoltages,
    Faults,
    Health,
    RodDipoleCommand,
    SpacecraftState,
    SunEstimate,
    WheelState,
)

_SIGMAS = 3.0
_USUAL = dict(SINGLE.values())
Samples = Mapping[str, tuple[Any, Sample]]
"""Class and message by topic."""


def _words(message: type, prefix: str) -> dict[int, str]:
    names = (name for name in dir(type(message)) if name.startswith(prefix))
    return {getattr(message, name): name.removeprefix(prefix).lower().replace("_", " ") for name in names}


_VALIDITIES = _words(SunEstimate, "VALIDITY_")
_RATES = _words(SunEstimate, "RATE_")
_REASONS = _words(ControlStatus, "REASON_")


class Frame(NamedTuple):
    """One instant.

    Attributes:
        shown: what the page shows, as JSON has it.
        row: values of the strip charts in the order of `series`; not a number where there is none.
        series: of the strip charts: chart, name and unit of each.
    """

    shown: dict[str, Any]
    row: list[float]
    series: tuple[tuple[str, str, str], ...]


class Spacecraft(NamedTuple):
    """What of it frames need to know.

    Attributes:
        array_normal: of the solar arrays, in b; None: not known.
        flies: name of the estimator that the control listens to; empty: not known.
    """

    array_normal: tuple[float, float, float] | None = None
    flies: str = ""


def frame_of(samples: Samples, stamp_ns: int, begin_ns: int, craft: Spacecraft) -> Frame:
    """The page's view of an instant.

    Args:
        samples: what was last said up to it.
        stamp_ns: of the instant.
        begin_ns: stamp from which the page counts its seconds.
        craft: the spacecraft.
    """
    shown: dict[str, Any] = {"time": (stamp_ns - begin_ns) * 1e-9, "utc": format_utc(stamp_ns)}
    chart = _Charts()
    truth = _first(samples, SpacecraftState)
    sun = None if truth is None else _sky(truth, shown)
    shown["estimates"] = [
        _estimate(topic, sample, sun, truth, craft, chart) for topic, sample in _all(samples, SunEstimate)
    ]
    shown["attitudes"] = [
        {"name": estimator_of(topic), "validity": _VALIDITIES.get(sample.validity, "?")}
        for topic, sample in _all(samples, AttitudeEstimate)
    ]
    if sun is not None and craft.array_normal is not None:
        shown["pointing_deg"] = math.degrees(angle_between(craft.array_normal, sun))
        chart.add("pointing", "arrays to the Sun", "deg", shown["pointing_deg"])
    if truth is not None:
        shown["rate_deg_s"] = _listed(np.degrees(truth.omega_bn_b))
        for axis, value in zip("xyz", shown["rate_deg_s"], strict=True):
            chart.add("rate", f"{axis} true", "deg/s", value)
    _hardware(samples, shown, chart)
    _control(samples, shown)
    shown["faults"] = [line for topic, sample in _all(samples, Faults) for line in _fault_lines(topic, sample)]
    shown["health"] = [row for topic, sample in _all(samples, Health) for row in _health_rows(topic, sample)]
    return Frame(shown, chart.row, tuple(chart.series))


class _Charts:
    def __init__(self) -> None:
        self.series: list[tuple[str, str, str]] = []
        self.row: list[float] = []

    def add(self, chart: str, name: str, unit_text: str, value: float | None) -> None:
        self.series.append((chart, name, unit_text))
        self.row.append(math.nan if value is None else value)


def _all(samples: Samples, kind: type) -> Iterable[tuple[str, Sample]]:
    return ((topic, sample) for topic, (of, sample) in samples.items() if of is kind)


def _first(samples: Samples, kind: type) -> Sample | None:
    """Of several topics of a type that a flight has once, that under Sunpoint's own name, else the first."""
    found = dict(_all(samples, kind))
    return found.get(_USUAL[kind], next(iter(found.values()), None))


def _listed(values: Iterable[float]) -> list[float]:
    return [float(value) for value in values]


def _bits(mask: int, count: int) -> list[int]:
    return [i for i in range(count) if mask >> i & 1]


def _sky(truth: Sample, shown: dict[str, Any]) -> tuple[float, float, float]:
    """The true Sun in b; Sun and Earth into what is shown."""
    dcm_bn = mrp_to_dcm(vector_of(truth.sigma_bn))
    sun: tuple[float, float, float] = unit(multiply(dcm_bn, vector_of(truth.sun_n)))
    r_n = vector_of(truth.r_n)
    distance = norm(r_n)
    shown["q_nb"] = _listed(dcm_to_quaternion(dcm_bn))  # as an operator it turns components in b into n
    shown["sun"] = _listed(sun)
    shown["sunlit"] = float(truth.illumination)
    if distance > 0.0:
        down = multiply(dcm_bn, scale(-1.0 / distance, r_n))
        # sun_deg: between the directions of Sun and Earth; at 180 deg all that is seen of the Earth shines
        shown["earth"] = {
            "b": _listed(down),
            "radius_deg": math.degrees(math.asin(min(1.0, EARTH_RADIUS / distance))),
            "sun_deg": math.degrees(angle_between(down, sun)),
        }
    return sun


def _estimate(
    topic: str,
    sample: Sample,
    sun: tuple[float, float, float] | None,
    truth: Sample | None,
    craft: Spacecraft,
    chart: _Charts,
) -> dict[str, Any]:
    name = estimator_of(topic)
    known = sample.validity != SunEstimate.VALIDITY_NONE and float(np.linalg.norm(sample.sun_b)) > 0.5
    sun_hat = vector_of(sample.sun_b)
    bound = error = None
    if known and sample.covariance[0] >= 0.0:
        bound = _SIGMAS * math.degrees(heading_sigma_of(sun_hat, sample.covariance))
    if known and sun is not None and truth is not None and truth.stamp_ns == sample.stamp_ns:
        error = math.degrees(angle_between(sun_hat, sun))
    chart.add("heading", f"{name} error", "deg", error)
    chart.add("heading", f"{name} 3 sigma", "deg", bound)
    rates = np.degrees(sample.omega_bn_b)
    has_rate = sample.rate_source != SunEstimate.RATE_NONE
    for axis, value in zip("xyz", rates, strict=True):
        chart.add("rate", f"{axis} {name}", "deg/s", float(value) if has_rate else None)
    return {
        "name": name,
        "flies": name == craft.flies,
        "sun": _listed(sun_hat) if known else None,
        "error_deg": error,
        "bound_deg": bound,
        "validity": _VALIDITIES.get(sample.validity, "?"),
        "rate_source": _RATES.get(sample.rate_source, "?"),
        "lit": _bits(sample.lit_mask, 32),
        "isolated": _bits(sample.isolated, 32),
        "nis": float(sample.nis),
        "nis_dof": int(sample.nis_dof),
        "age_s": float(sample.age),
        "eclipse": sample.eclipse == SunEstimate.ECLIPSE_ECLIPSED,
    }


def _hardware(samples: Samples, shown: dict[str, Any], chart: _Charts) -> None:
    wheels, rods = _first(samples, WheelState), _first(samples, RodDipoleCommand)
    cells = _first(samples, CssVoltages)
    if wheels is not None:
        shown["wheels_rpm"] = _listed(RPM * wheels.speed)
        for i, value in enumerate(shown["wheels_rpm"]):
            chart.add("wheels", f"wheel {i}", "rpm", value)
    if rods is not None:
        shown["rods"] = _listed(rods.dipole)
        for i, value in enumerate(shown["rods"]):
            chart.add("rods", f"rod {i}", "A m^2", value)
    if cells is not None:
        # a reading that there is not is NaN, which JSON has not
        shown["cells"] = [float(v) if math.isfinite(v) else None for v in cells.voltages]
        shown["saturated"] = _bits(cells.saturated, len(cells.voltages))
        for i, value in enumerate(shown["cells"]):
            chart.add("cells", f"cell {i}", "-", value)


def _control(samples: Samples, shown: dict[str, Any]) -> None:
    status = _first(samples, ControlStatus)
    if status is not None:
        error = status.pointing_error
        shown["control"] = {
            "mode": MODES.get(status.mode, f"mode {status.mode}"),
            "reason": _REASONS.get(status.reason, "?"),
            "error_deg": math.degrees(error) if error >= 0.0 else None,
            "wheels_isolated": _bits(status.wheels_isolated, 32),
            "rods_isolated": _bits(status.rods_isolated, 32),
            "dumping": bool(status.dumping),
        }


def _fault_lines(topic: str, sample: Sample) -> Iterable[str]:
    """As missions write them."""
    rows = sample.rows[: len(sample.rows) // 4 * 4].reshape(-1, 4)
    for sort, number, kind, row in zip(sample.sort, sample.unit, sample.kind, rows, strict=False):
        node, unit = topic.removeprefix("/faults/"), unit_name(int(sort), int(number))
        until = f" to={row[3]:g}" if row[3] >= 0.0 else ""
        yield f"{node}: {unit} {KIND_WORDS.get(int(kind), kind)} from={row[2]:g}{until}"


def _health_rows(topic: str, sample: Sample) -> Iterable[dict[str, Any]]:
    rows = sample.rows[: len(sample.rows) // 3 * 3].reshape(-1, 3)
    for sort, number, kind, evidence, row in zip(
        sample.sort, sample.unit, sample.kind, sample.evidence, rows, strict=False
    ):
        yield {
            "node": topic.rpartition("/")[2],
            "unit": unit_name(int(sort), int(number)),
            "kind": KIND_WORDS.get(int(kind), f"kind {kind}"),
            "evidence": EVIDENCE_WORDS.get(int(evidence), f"evidence {evidence}"),
            "since_s": float(row[2]),
        }
