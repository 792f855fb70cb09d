# SPDX-License-Identifier: Apache-2.0
"""A mission in the terms of `benchmarks/basilisk_flight.py`, so that Basilisk flies what the mission describes."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from css_common.mission import Mission
from css_common.random_streams import random_key
from css_environment.mission_environment import MissionEnvironment
from css_environment.reflectivity import zonal_reflectivity
from css_environment.sun import sun_positions
from css_sim import initial_conditions


def write_zonal_earth(file: Path) -> None:
    """The built-in zonal reflectivity in the form that Basilisk's albedo module reads.

    Fractions separated by commas, rows of 5 deg from south to north, columns from 180 deg west on.
    """
    np.savetxt(file, zonal_reflectivity().mean, fmt="%.6g", delimiter=",")


def basilisk_scenario(mission: Mission, reflectivity_file: Path) -> dict[str, Any]:
    """Orbit, spacecraft, errors, gains and initial state of the mission's case, for JSON; SI units and radians.

    The Sun (from the centre of the Earth) and the rotation of the Earth are those at the middle of the flight.

    Raises:
        MissionError: the mission has no node `dynamics`, `gyro` or `mrp_control`.
    """
    values, middle = mission.values, 0.5 * mission.values.mission.duration
    dynamics, gyro, control = (mission.node(name).values for name in ("dynamics", "gyro", "mrp_control"))
    environment = MissionEnvironment(values, field=False)
    start = environment.at(0.0)
    state = initial_conditions.initial_state(
        initial_conditions.parameters(dynamics), random_key(values.mission.seed, values.mission.case)
    )
    return {
        "seed": values.mission.case,
        "period": values.mission.period,
        "duration": values.mission.duration,
        "r_n": start.r_n,
        "v_n": start.v_n,
        "sun_position_n": sun_positions(mission.epoch_ns, middle)[0].tolist(),
        "dcm_en": np.reshape(environment.at(middle).dcm_en, (3, 3)).tolist(),
        "reflectivity_file": str(reflectivity_file),
        "inertia": values.spacecraft.inertia.tolist(),
        "array_normal": values.spacecraft.array_normal.tolist(),
        "sigma_bn": state.sigma_bn,
        "omega_bn_b": state.omega_bn_b,
        "wheel_axes": values.wheels.axes.tolist(),
        "wheel_inertia": values.wheels.inertia,
        "wheel_max_torque": values.wheels.max_torque,
        "wheel_max_speed_rpm": values.wheels.max_speed_rpm,
        "cell_normals": values.cells.normals.tolist(),
        "cell_half_view": math.radians(0.5 * values.cells.field_of_view_deg),
        "gyro_noise": math.radians(gyro.noise_deg_s),
        "gyro_bias": math.radians(gyro.bias_deg_h / 3600.0),
        "k": control.gains.k,
        "p": control.gains.p,
        "ki": control.gains.ki,
        "integral_limit": control.gains.integral_limit,
        "deadband": math.radians(control.deadband_deg),
    }
