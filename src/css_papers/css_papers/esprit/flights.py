# SPDX-License-Identifier: Apache-2.0
"""The flights behind the page: the mission as it stands, with a drift, and with more heads."""

from typing import NamedTuple

import numpy as np

from css_analysis.spin_consistency import attitude_error
from css_analysis.spin_flight import SpinFlight, attitude_matrix
from css_common.mission import Mission
from css_common.random_streams import random_key
from css_estimation.spin.coning import Coning, Passages, analyse_coning
from css_papers.esprit.spinning import fly_spinning
from css_sensors.slits import slit_inclination
from css_sim.spinning_payload import payload_motion, payload_state

MISSION = "esprit_2006"
HEADS = {"1 head": "0", "2 heads": "0,180", "4 heads": "0,90,180,270"}
_HEAD_SECONDS = 110.0  # some 40 s of them after the last deployment

DRIFT = ("payload.coning_period=0.65,0.2529,0.2529,0.26275", "payload.final_coning_period=0.25815")
"""A period that passes 0.2618 s in the middle of the up-leg and 0.2595 s in that of the down-leg."""


class Legs(NamedTuple):
    """Coning over the legs of a flight, and over both together."""

    up: Coning
    down: Coning


class AttitudeErrors(NamedTuple):
    """A attitudes against the truth."""

    time: np.ndarray  # (A,) [s]
    angle: np.ndarray  # (A,) [rad]
    nees: np.ndarray  # (A,)


def legs_of(flight: SpinFlight) -> Legs:
    """Coning over the legs that the mission gives its coning node.

    Raises:
        ValueError: a leg has too few passages.
    """
    node = flight.mission.node("coning").values
    inclination = slit_inclination(node)
    results = []
    for start, end in node.legs[:2].tolist():
        coning = analyse_coning(flight.passages.between(start, end), inclination, node.inertia_ratio)
        if coning is None:
            raise ValueError(f"too few passages between {start:g} and {end:g} s for the coning")
        results.append(coning)
    return Legs(*results)


def attitude_errors(flight: SpinFlight) -> AttitudeErrors:
    """Every attitude of the flight against the motion that flew."""
    sensor = flight.mission.node("slit_sensor").values
    key = random_key(flight.mission.values.mission.seed, flight.mission.values.mission.case)
    motion = payload_motion(sensor, flight.mission.epoch_ns, key)
    times, angles, nees = flight.attitude_times(), [], []
    for time, attitude in zip(times, flight.attitudes, strict=True):
        true = np.array(payload_state(motion, float(time)).dcm_bn)
        error = attitude_error(attitude_matrix(attitude.q_bn), true)
        covariance = attitude.covariance.reshape(6, 6)[:3, :3]
        angles.append(np.linalg.norm(error))
        nees.append(error @ np.linalg.solve(covariance, error))
    return AttitudeErrors(times, np.array(angles), np.array(nees))


def head_studies(mission: Mission) -> dict[str, Coning]:
    """Coning soon after the last deployment with several heads around the perimeter, nothing known of inertia."""
    results = {}
    for name, azimuths in HEADS.items():
        flown = mission.with_overrides(
            [f"slits.head_azimuths_deg={azimuths}", f"mission.duration={_HEAD_SECONDS}", "coning.legs=0,1000"]
        )
        passages = fly_spinning(flown).passages
        coning = analyse_coning(_steady(passages, mission), slit_inclination(mission.values))
        if coning is not None:
            results[name] = coning
    return results


def _steady(passages: Passages, mission: Mission) -> Passages:
    return passages.between(float(mission.values.payload.phase_starts[-1]) + 0.2, np.inf)
