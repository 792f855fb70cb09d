# SPDX-License-Identifier: Apache-2.0
"""Every number that is drawn for a case is one of its own: none is shared, shifted or mirrored from another.

All of them are gathered over many cases, one column each, and every pair of columns is tested, both the numbers and
their distances from the median (significance 1e-4 over all pairs, fixed seed).
"""

import numpy as np
import pytest
from okeefe_spacecraft import okeefe_values
from scipy import stats

from css_common.actuator_sections import WHEELS
from css_common.mission_section import MISSION
from css_common.orbit_section import ORBIT
from css_common.random_streams import Stream, random_key
from css_common.schema import default_values
from css_common.sections import SPACECRAFT
from css_environment import moving_clouds
from css_environment.orbit import KeplerianOrbit
from css_environment.reflectivity import Reflectivity, draw_reflectivity
from css_sensors.cells import CELLS
from css_sensors.slits import SLITS
from css_sim import (
    cell_errors,
    cell_screen,
    gyro,
    initial_conditions,
    latency,
    magnetometer,
    orbit_dispersion,
    slit_timer,
    sun_cells,
    tachometer,
    wheel_friction,
)
from css_sim.fault_effects import CELL, FAULT, NO_FAULTS, NOISY
from css_sim.random_walk import random_walk

CASES = 2000
SIGNIFICANCE = 1e-4
STILL = (0.0, 0.0, 0.0)
CELLS_DRAWN = 5  # more than one block of four draws has


def one_error(**changes):
    """Error statistics of the cells with one kind of error alone."""
    return cell_errors.error_model(default_values(cell_errors.PARAMETERS, **changes))


CELL_ERRORS = {
    "degradation": (one_error(fixed_degradation=0.5), "gain"),
    "common scale": (one_error(scale_common_error=0.1), "gain"),
    "scale": (one_error(scale_cell_error=0.1), "gain"),
    "bias": (one_error(bias=0.1), "bias"),
}


def gyro_draws(key):
    p = gyro.parameters(
        default_values(gyro.PARAMETERS, scale_error=0.01, misalignment_deg=0.5, noise_deg_s=1.0, bias_deg_h=1.0)
    )
    errors = gyro.draw_errors(p, key)
    quiet = p._replace(bias=0.0)
    still = gyro.draw_errors(quiet, key)
    yield from (("gyro bias", b) for b in errors.bias_b)
    yield from (("gyro response", r) for row in errors.response for r in row)
    yield from (("gyro walk", w) for w in random_walk(key, Stream.GYRO_BIAS, 4, 7))
    for step in (0, 1):
        yield from ((f"gyro noise {step}", n) for n in gyro.measure(quiet, still, NO_FAULTS, key, step, STILL))


def magnetometer_draws(key):
    p = magnetometer.parameters(default_values(magnetometer.PARAMETERS, bias_nt=100.0))
    yield from (("field bias", b) for b in magnetometer.draw_bias(p, key))
    for step in (0, 1):
        yield from ((f"field noise {step}", n) for n in magnetometer.measure(p, STILL, NO_FAULTS, key, step, STILL))


def cell_draws(key, nominal):
    drawn = nominal.copy()
    for name, (model, field) in CELL_ERRORS.items():
        cell_errors.draw_cells(model, key, nominal, drawn)
        yield from ((name, v) for v in (drawn[field][:1] if name == "common scale" else drawn[field]))
    cell_errors.draw_cells(one_error(misalignment_deg=2.0), key, nominal, drawn)
    # all normals are alike: what a tilt moves them by along x and y
    yield from (("tilt", v) for v in (*drawn["nx"], *drawn["ny"]))


def output_draws(key, nominal, quiet):
    """What is drawn at a step: degradation in either mode, noise, and that of a noisy cell."""
    out = np.zeros(CELLS_DRAWN)
    noisy = np.array([(CELL, 0, NOISY, 0, 1.0, 0.0, 0, 9, 0.0)], FAULT)
    light = np.ones(CELLS_DRAWN)
    variants = (
        ("loss of all", quiet._replace(degradation=0.5), NO_FAULTS, 1),
        ("loss", quiet._replace(degradation=0.5, degradation_per_cell=True), NO_FAULTS, CELLS_DRAWN),
        ("noise", quiet._replace(noise=0.1), NO_FAULTS, CELLS_DRAWN),
        ("fault", quiet, noisy, 1),
    )
    for step in (0, 1):
        for name, p, faults, count in variants:
            sun_cells.sample(p, nominal, faults, key, step, (0.0, 0.0, -1.0), 0.0, light, out)
            yield from ((f"{name} {step}", v) for v in out[:count])


def start_draws(key, values, conditions):
    state = initial_conditions.initial_state(conditions, key)
    yield from (("rate", w) for w in state.omega_bn_b)
    yield from (("attitude", s) for s in state.sigma_bn)
    body = initial_conditions.dispersed_body(values, key)
    yield from (("moment", body.inertia[i][i]) for i in range(3))
    yield from (("torque", t) for t in body.wheels["max_torque"])


def earth_draws(key, grid, room):
    draw_reflectivity(grid, key, True, room)
    yield "reflectivity of all", room[0, 0]
    draw_reflectivity(grid, key, False, room)
    yield from (("reflectivity", v) for v in room.ravel())


def slit_draws(key, timer):
    ticks, codes = np.zeros(4, np.int64), np.zeros((4, 2), np.int64)
    for step in (0, 1):
        times = np.array([100.0, 200.0])
        slit_timer.read_pulses(timer, key, step, 2, times, np.zeros(2, np.int64), np.zeros(2, np.int64), ticks, codes)
        yield from ((f"jitter {step}", float(t)) for t in ticks[:2])


def truth_draws(key, plant, grid):
    orbit = orbit_dispersion.case_orbit(plant, key)
    assert isinstance(orbit, KeplerianOrbit)
    yield from (("orbit", x) for x in (orbit.semi_major_axis, orbit.inclination, orbit.raan, orbit.true_anomaly))
    late = latency.Latency(3.0, 2.0)
    sensors = (latency.CELLS, latency.GYRO, latency.MAGNETOMETER)
    yield from (("latency", latency.draw_lag(late, key, sensor)) for sensor in sensors)
    rubbing = wheel_friction.Friction(1.0, 0.0, 0.1)
    yield from (("friction", f) for f in wheel_friction.dispersed_friction(rubbing, key, 4)[0])
    for step in (0, 1):
        speeds = np.zeros(CELLS_DRAWN)
        tachometer.report(tachometer.Tachometer(1.0, 0.0), NO_FAULTS, key, step, speeds)
        yield from ((f"tachometer {step}", s) for s in speeds)
    motion = moving_clouds.draw_motion(key, 3, 0.0, 1.0, 1.0)
    yield from (("motion of clouds", m) for m in (motion.drift, motion.phase))
    (_, later) = moving_clouds.draw_fields(grid, key, moving_clouds.PER_CELL, 1.0, 2)
    yield from (("clouds to come", g) for g in later.ravel())
    yield "common clouds to come", moving_clouds.draw_fields(grid, key, moving_clouds.COMMON, 1.0, 2)[1, 0, 0]


@pytest.fixture(scope="module")
def draws():
    """Names of the columns, and what was drawn, (cases, columns)."""
    nominal = cell_errors.nominal_cells(np.tile([0.0, 0.0, 1.0], (CELLS_DRAWN, 1)))
    cells = okeefe_values(
        CELLS + sun_cells.PARAMETERS + cell_screen.PARAMETERS,
        warp=False,
        degradation=0.0,
        output_low=-10.0,
        output_high=10.0,
    )
    quiet = sun_cells.parameters(cells)
    start = okeefe_values(
        MISSION + SPACECRAFT + WHEELS + initial_conditions.PARAMETERS,
        dispersion__inertia=0.01,
        dispersion__wheel_torque=0.1,
    )
    plant = okeefe_values(
        MISSION + ORBIT + orbit_dispersion.PARAMETERS,
        **{f"dispersion__orbit__{k}": 0.1 for k in ("altitude", "inclination_deg", "raan_deg", "true_anomaly_deg")},
    )
    conditions = initial_conditions.parameters(start)
    grid = Reflectivity(np.full((2, 3), 0.5), np.full((2, 3), 0.05))
    timer = slit_timer.parameters(default_values(SLITS + slit_timer.PARAMETERS, jitter_us=1e4))
    rows = []
    for case in range(CASES):
        key = random_key(20130601, case)
        row = [
            *gyro_draws(key),
            *magnetometer_draws(key),
            *cell_draws(key, nominal),
            *output_draws(key, nominal, quiet),
            *start_draws(key, start, conditions),
            *earth_draws(key, grid, np.zeros((2, 3))),
            *slit_draws(key, timer),
            *truth_draws(key, plant, grid),
        ]
        rows.append([value for _, value in row])
    return [name for name, _ in row], np.array(rows, dtype=float)


@pytest.mark.parametrize("distance", [False, True], ids=["values", "distances"])
def test_no_two_numbers_of_a_case_are_related(draws, distance):
    names, values = draws
    assert np.all(np.ptp(values, axis=0) > 0.0)
    if distance:
        values = np.abs(values - np.median(values, axis=0))
        # the parts of an MRP have a length of their own, and stay out of this
        columns = [i for i, name in enumerate(names) if name != "attitude"]
        names, values = [names[i] for i in columns], values[:, columns]
    pairs = np.triu_indices(len(names), 1)
    correlation = stats.spearmanr(values).statistic[pairs]
    limit = stats.norm.isf(SIGNIFICANCE / len(correlation) / 2.0) / np.sqrt(CASES)
    related = [(names[i], names[j], r) for i, j, r in zip(*pairs, correlation, strict=True) if not abs(r) < limit]
    assert related == []
    # and together they scatter as those of independent numbers
    assert stats.kstest(correlation * np.sqrt(CASES), "norm").pvalue > SIGNIFICANCE
