# SPDX-License-Identifier: Apache-2.0
"""The numbers of Reichard et al. beside ours, and what ours must be."""

import math

import numpy as np

from css_analysis.spin_consistency import AttitudeCases
from css_common.mission import Mission
from css_common.random_streams import random_key
from css_environment.mission_environment import MissionEnvironment
from css_estimation.spin.coning import Coning, Passages
from css_estimation.spin.coning_angle import max_min_angle
from css_estimation.spin.slit_angles import motion_gain, quantum, sun_angle
from css_papers.esprit.flights import AttitudeErrors, Legs
from css_papers.rows import Must, Row, row
from css_sensors.slits import LOWER, UPPER, slit_inclination
from css_sim.slit_crossings import slit_crossings, slit_geometry
from css_sim.spinning_payload import payload_motion, payload_state

FULL_ANGLE, UP_PERIOD, DOWN_PERIOD = 12.89, 0.2618, 0.2595
_DIMENSIONS = 3  # of an attitude error
_TWO_SIDED = 1.96  # standard deviations that hold 95 % of a mean


def rate_rows(mission: Mission, passages: Passages) -> list[Row]:
    """Rotation rate before and after the booms."""
    booms, end = float(mission.values.payload.phase_starts[-1]), mission.values.payload.flat_spin_start
    before, after = (_spin(passages.between(a, b)) for a, b in ((0.0, booms), (booms + 1.0, end)))
    note = "mean of turns; coning makes single turns read from 5.33 to 5.58 Hz at a constant spin"
    return [
        row("rotation rate before boom deployment", "Hz", 6.0, before, _within(6.0, 0.005), digits=4),
        row("rotation rate after boom deployment", "Hz", 5.45, after, _within(5.45, 0.005), note=note, digits=4),
    ]


def _spin(passages: Passages) -> float:
    return 1.0 / float(np.mean(2.0 * np.pi / passages.rate))


def _within(value: float, share: float) -> Must:
    return Must(value * (1.0 - share), value * (1.0 + share))


def angle_rows(legs: Legs, truth_max_min: float) -> list[Row]:
    """Coning angle, by the paper's method and by motions fitted to the pulses."""
    fitted = math.degrees(0.5 * (legs.up.full_angle + legs.down.full_angle))
    read = math.degrees(0.5 * (legs.up.max_min_angle + legs.down.max_min_angle))
    return [
        row("coning full angle, fitted", "deg", FULL_ANGLE, fitted, Must(FULL_ANGLE - 0.3, FULL_ANGLE + 0.3), digits=4),
        row(
            "coning full angle, maxima less minima",
            "deg",
            FULL_ANGLE,
            read,
            note=bias_note(legs.up, truth_max_min),
            digits=4,
        ),
    ]


def bias_note(coning: Coning, truth_max_min: float) -> str:
    """Why maxima less minima read too little, in numbers."""
    true, read = math.degrees(coning.full_angle), math.degrees(coning.max_min_angle)
    sampled = math.degrees(truth_max_min)
    in_phase, quadrature = motion_gain(coning.sun_angle, math.radians(30.0), coning.frequency / coning.spin)
    share = math.hypot(1.0 + in_phase, quadrature)
    return (
        f"of {true - read:.2f} deg that the paper's method reads too little, {true - sampled:.2f} come from one sample "
        f"a turn, which misses the extrema of a coning of {coning.frequency / coning.spin:.2f} periods a turn (perfect "
        f"Sun angles at the same instants read {sampled:.2f}), and {sampled - read:.2f} from motion during a passage, "
        f"which leaves {100.0 * share:.0f} % of the swing (a sinusoid through the Sun angles reads "
        f"{math.degrees(coning.sine.full_angle):.2f})"
    )


def true_max_min(mission: Mission, coning: Coning, passages: Passages) -> float:
    """What maxima less minima [rad] make of perfect Sun angles at the instants of a window."""
    sensor = mission.node("slit_sensor").values
    motion = payload_motion(
        sensor, mission.epoch_ns, random_key(mission.values.mission.seed, mission.values.mission.case)
    )
    part = passages.between(coning.start, np.nextafter(coning.end, np.inf))
    sun_n = sun_direction(mission)
    angles = [math.asin(float(np.array(payload_state(motion, t).dcm_bn)[2] @ sun_n)) for t in part.time.tolist()]
    return max_min_angle(np.array(angles))


def sun_direction(mission: Mission) -> np.ndarray:
    """(3,) direction to the Sun in n half-way through the flight, in which it turns by 1e-4 rad."""
    environment = MissionEnvironment(mission.node("slit_sensor").values, field=False)
    return np.array(environment.at(0.5 * mission.values.mission.duration).sun_n)


def period_rows(legs: Legs, drifting: Legs) -> list[Row]:
    """Coning period by the paper's Fourier transform, torque-free and with a drift."""
    rows = []
    for variant, flown in (("", legs), ("drift", drifting)):
        up, down = (1.0 / float(leg.candidates[leg.chosen].sequence_frequency) for leg in flown)
        up_must = _within(UP_PERIOD, 0.004)
        down_must = _within(DOWN_PERIOD if variant else UP_PERIOD, 0.004)
        resolution = 1e3 * flown.down.resolution
        note = (
            ""
            if variant
            else "torque-free motion has one period; the window of the down-leg blurs it by "
            f"{resolution:.1f} ms, less than the 2.3 ms between the paper's legs. With a drift of the period over the "
            "phase (payload.final_coning_period) both of the paper's numbers come out"
        )
        rows.append(row("coning period up-leg, FFT", "s", UP_PERIOD, up, up_must, note=note, variant=variant, digits=4))
        rows.append(
            row("coning period down-leg, FFT", "s", DOWN_PERIOD, down, down_must, note=note, variant=variant, digits=4)
        )
    return rows


def alias_rows(legs: Legs, mission: Mission) -> list[Row]:
    """Candidates of the coning frequency, and whether the chosen one is true."""
    true = 1.0 / float(mission.values.payload.coning_period[-1])
    off = max(abs(leg.frequency - true) for leg in legs)
    width = max(1.0 / (leg.end - leg.start) for leg in legs)
    note = f"a bin of the window is {1e3 * width:.1f} mHz wide"
    found = max(len(leg.candidates) for leg in legs)
    residuals = [r for leg in legs for i, r in enumerate(leg.residuals) if i != leg.chosen and r >= 0.0]
    own = max(leg.residuals[leg.chosen] for leg in legs)
    return [
        row("candidates of the coning frequency", "-", None, found, Must(1.0, 4.0)),
        row("chosen coning frequency less the true one", "mHz", None, 1e3 * off, Must(0.0, 1e3 * width), note=note),
        row("pulses missed by the motion of the chosen one", "us", None, 1e6 * own),
        row("pulses missed by the motion of any other", "us", None, 1e6 * min(residuals), Must(10.0 * 1e6 * own, None)),
    ]


def attitude_rows(mission: Mission, errors: AttitudeErrors, cases: AttitudeCases) -> list[Row]:
    """Attitude against the truth, in the flight and over many cases."""
    booms, end = float(mission.values.payload.phase_starts[-1]), mission.values.payload.flat_spin_start
    steady = (errors.time > booms + 1.0) & (errors.time < end)
    count = len(cases.nees)
    bound = _TWO_SIDED * math.sqrt(2.0 * _DIMENSIONS / max(count, 1))
    note = f"{count} cases; expected {_DIMENSIONS}, 95 % bounds of their mean"
    return [
        row("attitude error, rms", "deg", None, math.degrees(float(np.sqrt(np.mean(errors.angle[steady] ** 2))))),
        row("attitude NEES of the flight, mean", "-", None, float(np.mean(errors.nees[steady]))),
        row(
            "attitude NEES of cases, mean", "-", None, float(np.mean(cases.nees)) if count else None,
            Must(_DIMENSIONS - bound, _DIMENSIONS + bound), note=note,
        ),
    ]  # fmt: skip


def fixed_axis_row(mission: Mission) -> Row:
    """Largest error of the Sun angle for a fixed spin axis, at Sun angles within 55 deg."""
    sensor = mission.node("slit_sensor").values
    steady = mission.with_overrides(["payload.coning_angle_deg=0,0,0,0"]).node("slit_sensor").values
    motion = payload_motion(steady, mission.epoch_ns, random_key(mission.values.mission.seed, 0))
    geometry, frequency = slit_geometry(sensor), sensor.slits.counter_hz
    inclination = slit_inclination(sensor)
    start = float(sensor.payload.phase_starts[-1]) + 1.0
    axes = np.array(payload_state(motion, start).dcm_bn)
    room = 64
    times, slits, heads = np.zeros(room), np.zeros(room, dtype=np.int64), np.zeros(room, dtype=np.int64)
    worst = 0.0
    for degrees in np.linspace(-55.0, 55.0, 441):
        true = math.radians(degrees)
        sun_n = math.cos(true) * axes[0] + math.sin(true) * axes[2]
        count = slit_crossings(motion, geometry, tuple(sun_n.tolist()), start + 0.05, start + 0.7, times, slits, heads)
        first = np.array(slits[:count])
        upper = np.floor(times[:count][first == UPPER] * frequency).astype(int)
        lower = np.floor(times[:count][first == LOWER] * frequency).astype(int)
        turn = int(upper[1] - upper[0])
        interval = int(lower[np.argmin(np.abs(lower - upper[1]))] - upper[1])
        error = abs(sun_angle(interval, turn, inclination) - true)
        worst = max(worst, error / quantum(interval, turn, inclination))
    return row("Sun angle error, fixed axis, within 55 deg", "counts", None, worst, Must(0.0, 2.0))
