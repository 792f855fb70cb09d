# SPDX-License-Identifier: Apache-2.0
"""Flights that begin with the pyramid staring at doubled albedo: the light must not be taken for the Sun."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from css_analysis.flight_log import angle
from css_analysis.flight_metrics import acquisition
from css_common.attitude import dcm_to_mrp
from css_common.mission import Mission, load_mission
from css_common.random_streams import random_key
from css_common.vectors import mat3
from css_environment.albedo_vector import albedo_vector
from css_environment.mission_environment import MissionEnvironment
from css_estimation.sun.safe_hold import MODE_PYRAMID, MODE_PYRAMID_DENIED
from css_monte_carlo.direct_flight import fly_directly
from css_papers.clark.flights import DOUBLED, PYRAMID
from css_papers.page import Table
from css_papers.rows import Must, Row, row
from css_sim import earth_reflectivity

_DURATION_S = 1200.0
_ROLLS = 3
_ORBIT_DEG = tuple(range(0, 360, 15))
# Light that makes each cell of the pyramid read its 15 % and a little, and that the collar does not cut.
_LEAST_LIGHT = 0.32
_APART_DEG = 60.0
ADOPTED_WITHIN = Must(None, 10.0)


class Stare(NamedTuple):
    """One flight."""

    orbit_deg: float  # from the ascending node
    light: float  # of the Earth [-], relative to the Sun
    apart_deg: float  # from it to the Sun
    denied_s: float  # time in which the flat cells denied the light on the pyramid
    adopted_error_deg: float  # largest error while the pyramid was believed; NaN: it never was
    acquired_s: float  # infinite: never


def stare_starts(mission: Mission) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Places [deg] of the orbit where the Earth is bright and far from the Sun; light and Sun direction there, in n."""
    places = []
    for place in _ORBIT_DEG:
        there = mission.with_overrides([f"orbit.true_anomaly_deg={place}"])
        values = there.node("css_array").values
        e = MissionEnvironment(there.values, field=False).at(0.0)
        grid = earth_reflectivity.source(values, there.epoch_ns)
        reflectivity = earth_reflectivity.case_reflectivity(values, grid, random_key(1, 0))
        light = np.array(albedo_vector(e.r_n, e.sun_n, e.solar_flux, e.dcm_en, reflectivity))
        sun_n = np.array(e.sun_n)
        if np.linalg.norm(light) >= _LEAST_LIGHT and np.degrees(angle(light, sun_n)) >= _APART_DEG:
            places.append((float(place), light, sun_n))
    return places


def facing(normal_b: np.ndarray, direction_n: np.ndarray, roll: float) -> np.ndarray:
    """(3,) MRP of an attitude in which a normal in b points along a direction in n, rolled about it by an angle."""

    def triad(first: np.ndarray, turn: float) -> np.ndarray:
        first = first / np.linalg.norm(first)
        second = np.cross(first, np.eye(3)[int(np.argmin(np.abs(first)))])
        second /= np.linalg.norm(second)
        third = np.cross(first, second)
        c, s = math.cos(turn), math.sin(turn)
        return np.array([first, c * second + s * third, c * third - s * second])

    dcm_bn = triad(normal_b, 0.0).T @ triad(direction_n, roll)
    return np.array(dcm_to_mrp(mat3(dcm_bn)))


def fly_stares(duration_s: float = _DURATION_S, most: int | None = None) -> list[Stare]:
    """Flies from every such place, rolled to several angles about the panel normal, at rest."""
    mission = load_mission(PYRAMID, [*DOUBLED, f"mission.duration={duration_s}"])
    normal_b = mission.values.spacecraft.array_normal
    stares = []
    for place, light, sun_n in stare_starts(mission):
        for roll in range(_ROLLS):
            sigma = facing(normal_b, light, 2.0 * math.pi * roll / _ROLLS)
            stares.append(_fly(mission, place, light, sun_n, sigma))
            if most is not None and len(stares) >= most:
                return stares
    return stares


def _fly(mission: Mission, place: float, light: np.ndarray, sun_n: np.ndarray, sigma: np.ndarray) -> Stare:
    overrides = [
        f"orbit.true_anomaly_deg={place}",
        "dynamics.initial.attitude=fixed",
        "dynamics.initial.sigma_bn=" + ",".join(f"{c:.9f}" for c in sigma),
        "dynamics.initial.omega_deg_s=0,0,0",
    ]
    log = fly_directly(mission.with_overrides(overrides))
    estimates = log.estimates[mission.values.graph.estimator]
    rows, steps = log.truth_rows(estimates)
    mode = estimates.mode[rows]
    on = mode == MODE_PYRAMID
    errors = np.degrees(angle(estimates.sun_b[rows], log.sun_b[steps]))
    start = acquisition(log)
    return Stare(
        orbit_deg=place,
        light=float(np.linalg.norm(light)),
        apart_deg=float(np.degrees(angle(light, sun_n))),
        denied_s=float(np.count_nonzero(mode == MODE_PYRAMID_DENIED)) * log.period,
        adopted_error_deg=float(errors[on].max()) if on.any() else float("nan"),
        acquired_s=math.inf if start is None else float(log.time(log.having("truth"))[start]),
    )


def stare_rows(stares: Sequence[Stare]) -> list[Row]:
    """What came of the stares."""
    denied = [stare for stare in stares if stare.denied_s > 0.0]
    adopted = [s.adopted_error_deg for s in stares if math.isfinite(s.adopted_error_deg)]
    acquired = sum(math.isfinite(stare.acquired_s) for stare in stares)
    return [
        row("stares: denied by flat cells", "%", None, 100.0 * len(denied) / max(len(stares), 1), Must(100.0)),
        row("stares: largest error on the pyramid", "deg", None, max(adopted, default=0.0), ADOPTED_WITHIN),
        row("stares: Sun found", "%", None, 100.0 * acquired / max(len(stares), 1), Must(100.0)),
    ]


def stare_table(stares: Sequence[Stare]) -> Table:
    """One line a flight."""
    heading = ["from the node [deg]", "light [-]", "from the Sun [deg]", "denied [s]",
               "largest error on the pyramid [deg]", "within 30 deg of the Sun after [s]"]  # fmt: skip
    lines = [
        [f"{s.orbit_deg:g}", f"{s.light:.2f}", f"{s.apart_deg:.0f}", f"{s.denied_s:.0f}", f"{s.adopted_error_deg:.1f}",
         f"{s.acquired_s:.0f}"]
        for s in stares
    ]  # fmt: skip
    return Table(heading, lines)
