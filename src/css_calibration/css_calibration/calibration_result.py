# SPDX-License-Identifier: Apache-2.0
"""What a calibration came to: rows for people and scripts, residuals against incidence, outliers, the file."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from css_calibration.attitude_track import BIAS, COMMON_SIGMA, FIELD_BIAS, FIELD_SCALE, SOFT_IRON
from css_calibration.calibration import UNTOLD, Calibration
from css_calibration.cell_fit_model import DARK, GAIN, KAPPA, TILT_1, TILT_2, normals_of
from css_calibration.unknowns import weak_directions
from css_common.epochs import format_utc
from css_common.mission_file import dump_sections
from css_estimation.sun_filter.calibration_report import OBSERVED

_BINS_DEG = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0)
_CELL_ROWS = (
    ("scale", GAIN, "-", 1.0),
    ("dark", DARK, "-", 1.0),
    ("tilt_1", TILT_1, "deg", math.degrees(1.0)),
    ("tilt_2", TILT_2, "deg", math.degrees(1.0)),
    ("temperature_coefficient", KAPPA, "1/K", 1.0),
)
_AIDS = (
    ("gyro_bias", BIAS, "xyz", "deg/h", math.degrees(3600.0)),
    ("field_bias", FIELD_BIAS, "xyz", "nT", 1e9),
    ("field_scale", FIELD_SCALE, "xyz", "-", 1.0),
    ("soft_iron", SOFT_IRON, ("xy", "xz", "yz"), "-", 1.0),
)
_NAMED = 0.35  # share of a weak direction from which a parameter is named
_ALONE = 0.99  # of a direction, above which it is one parameter


class Row(NamedTuple):
    """One parameter."""

    name: str
    cell: int | None
    value: float
    sigma: float
    unit: str
    observable: bool


def rows_of(c: Calibration) -> list[Row]:
    """All parameters; `field_scale` is the excess over one."""
    parameters, sigma = c.parameters, c.sigma
    rows = []
    for i in range(len(parameters)):
        for name, k, unit, factor in _CELL_ROWS:
            if c.fit.unknowns.free[i, k]:
                told = bool(c.observed[i, k])
                rows.append(Row(name, i, factor * parameters[i, k], factor * sigma[i, k], unit, told))
    if c.fit.unknowns.earth:
        place = c.fit.unknowns.count - 1
        left = math.sqrt(c.fit.covariance[place, place])
        rows.append(Row("earth", None, c.fit.earth, left * c.fit.unknowns.ignorance.earth, "-", left < OBSERVED))
    return rows + list(_aid_rows(c))


def _aid_rows(c: Calibration) -> Iterator[Row]:
    values, sigmas = np.zeros(len(COMMON_SIGMA)), np.full(len(COMMON_SIGMA), np.nan)
    common = c.common()
    if common is not None:
        values, sigmas = common
    if c.bias is not None:
        values[BIAS], sigmas[BIAS] = c.bias.x, c.bias.sigma
    if c.of_field is not None:
        values[3:], sigmas[3:] = c.of_field.x, c.of_field.sigma
    for name, place, axes, unit, factor in _AIDS:
        for axis, value, sigma, before in zip(axes, values[place], sigmas[place], COMMON_SIGMA[place], strict=True):
            if math.isfinite(sigma):
                told = bool(bool(sigma / before < OBSERVED))
                yield Row(f"{name}_{axis}", None, factor * value if told else 0.0, factor * sigma, unit, told)


def unobserved_combinations(c: Calibration) -> list[str]:
    """What the outputs did not tell: parameters by cell, then combinations, each as the parameters that make it."""
    count = c.fit.unknowns.count
    names = [
        f"cell {i}: {name}" for i in range(len(c.left)) for name, k, _, _ in _CELL_ROWS if c.fit.unknowns.free[i, k]
    ]
    names += ["earth"] * c.fit.unknowns.earth
    alone: dict[str, list[str]] = {}
    found = []
    for direction in weak_directions(_of_cells(c.fit.information, count)):
        order = np.argsort(-np.abs(direction))
        if abs(direction[order[0]]) > _ALONE:
            cell, _, name = names[order[0]].rpartition(": ")
            alone.setdefault(cell, []).append(name)
            continue
        parts = [f"{direction[i]:+.2f} {names[i]}" for i in order if abs(direction[i]) > _NAMED]
        found.append(" ".join(parts or [f"{direction[i]:+.2f} {names[i]}" for i in order[:4]]))
    return [f"{cell}: {', '.join(told)}" if cell else ", ".join(told) for cell, told in alone.items()] + found


def _of_cells(information: np.ndarray, count: int) -> np.ndarray:
    """Normal matrix of the first unknowns once the others, of the track, are reduced out (Schur's complement)."""
    if count == len(information):
        return information
    others = information[count:, count:] + np.eye(len(information) - count)
    mixed = information[:count, count:]
    return information[:count, :count] - mixed @ np.linalg.solve(others, mixed.T)


def residual_rows(c: Calibration) -> list[dict[str, Any]]:
    """Mean and root mean square of the residuals of each cell, by the angle of incidence of the Sun."""
    normals_b = normals_of(c.data.normals_b, c.parameters)
    angle = np.degrees(np.arccos(np.clip(c.data.incidence_cosine(normals_b), -1.0, 1.0)))
    rows = []
    for i in range(angle.shape[1]):
        for low, high in pairwise(_BINS_DEG):
            inside = c.data.seen[:, i] & (angle[:, i] >= low) & (angle[:, i] < high) & ~c.fit.outliers[:, i]
            off = c.fit.residuals[inside & np.isfinite(c.fit.residuals[:, i]), i]
            if len(off):
                rms = float(np.sqrt(np.mean(off**2)))
                row = {"cell": i, "from_deg": low, "to_deg": high, "outputs": len(off)}
                rows.append(row | {"mean": float(off.mean()), "rms": rms})
    return rows


def outlier_rows(c: Calibration) -> list[dict[str, Any]]:
    """Outputs that were left out: how many of each cell, the first and the last, and the largest residual."""
    rows = []
    for i in np.flatnonzero(c.fit.outliers.any(axis=0)):
        at = np.flatnonzero(c.fit.outliers[:, i])
        rows.append({
            "cell": int(i), "outputs": len(at), "of": int(np.isfinite(c.fit.residuals[:, i]).sum()),
            "from": format_utc(int(c.recorded.stamp_ns[at[0]])), "to": format_utc(int(c.recorded.stamp_ns[at[-1]])),
            "largest": float(np.max(np.abs(c.fit.residuals[at, i]))),
        })  # fmt: skip
    return rows


def mean_deg(angles: np.ndarray) -> float | None:
    """Mean of angles [rad] in degrees; None of none."""
    return math.degrees(float(angles.mean())) if len(angles) else None


def calibration_file(c: Calibration, source: str, extends: str | None) -> str:
    """Parameter file: a calibration for `--calibration`, `--params-file`, or with `extends` a mission.

    Args:
        source: recording that it was made of.
        extends: mission to say so for.
    """
    parameters, rows = c.parameters, {row.name: row for row in rows_of(c)}
    shared: dict[str, Any] = {"extends": extends} if extends else {}
    shared["cells.measured.normals"] = _rounded(normals_of(c.data.normals_b, parameters).ravel(), 9)
    shared["cells.measured.scales"] = _rounded(parameters[:, GAIN], 6)
    shared["cells.measured.darks"] = _rounded(parameters[:, DARK], 6)
    if c.fit.unknowns.free[:, KAPPA].any():
        shared["cells.measured.temperature_coefficients"] = _rounded(parameters[:, KAPPA], 7)
        shared["cells.measured.temperature"] = c.reference_temperature
    if any(name.startswith("gyro_bias") for name in rows):
        shared["gyro.measured.bias_deg_h"] = _rounded([rows[f"gyro_bias_{axis}"].value for axis in "xyz"], 4)
    if any(name.startswith("field_bias") for name in rows):
        shared["magnetometer.measured.bias_nt"] = _rounded([rows[f"field_bias_{axis}"].value for axis in "xyz"], 2)
        matrix = np.diag([1.0 + rows[f"field_scale_{axis}"].value for axis in "xyz"])
        for (i, j), pair in zip(((0, 1), (0, 2), (1, 2)), ("xy", "xz", "yz"), strict=True):
            matrix[i, j] = matrix[j, i] = rows[f"soft_iron_{pair}"].value
        shared["magnetometer.measured.matrix"] = _rounded(matrix.ravel(), 7)
    begin, end = (format_utc(int(c.recorded.stamp_ns[k])) for k in (0, -1))
    left_alone, together = not_told(c)
    head = [
        f"Calibration of {c.recorded.mission.name} by {source}, {begin} to {end}.",
        f"Reference: {c.reference}; response of the cells: {c.curve}. Scales hold at {c.reference_temperature:g} deg C."
        if "cells.measured.temperature" in shared
        else f"Reference: {c.reference}; response of the cells: {c.curve}.",
        *_named("What the recording did not tell is as the mission has it:", left_alone),
        *_named("Told together with others alone, so that each by itself is hardly known:", together),
    ]
    return "".join(f"# {line}\n" for line in head) + dump_sections({"/**": shared})


def not_told(c: Calibration) -> tuple[list[Row], list[Row]]:
    """Rows that are not observable: those left as they were, and those whose value is in the file all the same."""
    column = {name: k for name, k, _, _ in _CELL_ROWS}
    rows = [row for row in rows_of(c) if not row.observable]
    together = [row for row in rows if row.cell is not None and c.left[row.cell, column[row.name]] < UNTOLD]
    return [row for row in rows if row not in together], together


def _named(title: str, rows: list[Row]) -> Iterator[str]:
    if rows:
        yield title
    for row in rows:
        yield f"  {row.name}{'' if row.cell is None else f' of cell {row.cell}'}"


def _rounded(values: Any, digits: int) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]


def result_object(c: Calibration, source: str, file: str | None) -> dict[str, Any]:
    """What `--json` prints."""
    return {
        "recording": source,
        "mission": c.recorded.mission.name,
        "reference": c.reference,
        "response": c.curve,
        "instants": len(c.recorded.stamp_ns),
        "parameters": [row._asdict() for row in rows_of(c)],
        "heading_error_before_deg": mean_deg(c.before),
        "heading_error_after_deg": mean_deg(c.after),
        "holdout_instants": len(c.before),
        "noise": {"white": c.fit.noise.white, "relative": c.fit.noise.relative, "slow_factor": c.fit.slow},
        "not_observable": unobserved_combinations(c),
        "residuals": residual_rows(c),
        "outliers": outlier_rows(c),
        "notes": c.notes,
        "file": file,
    }
