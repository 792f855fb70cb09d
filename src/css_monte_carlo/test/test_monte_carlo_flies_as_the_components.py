# SPDX-License-Identifier: Apache-2.0
"""The compiled loop against the components of the nodes, called one after the other: equal at every step."""

import numpy as np
import pytest
from listing import MISSIONS, anywhere, controlled_by

from css_analysis.configured_mission import configured
from css_common.mission import load_mission, mission_from_text
from css_common.mission_file import MissionError
from css_estimation.sun.safe_hold import MODE_FLAT, MODE_PYRAMID, MODE_SHADOW
from css_estimation.sun.sun_estimator import SunEstimator
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.direct_flight import fly_directly
from css_monte_carlo.mission_flight import MissionFlight
from css_monte_carlo.mission_parts import NoPlace
from css_monte_carlo.surroundings import BLOCK_STEPS
from css_msgs.msg import SunEstimate
from sunpoint_control.nodes.magnetic_control import MagneticControl

CASES = np.array([0, 4])

RODS = (
    "graph.nodes=css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_sim/magnetometer,css_estimation/ekf,"
    "sunpoint_control/mrp_control"
)
FAILING_WHEELS = (
    "dynamics.faults=wheel.0 dead from 1,wheel.2 sign from 0,tachometer.1 scaled 1.5 from 3,wheel.3 stuck 0.01 from 9"
)
CALIBRATED = (
    "cells.measured.scales=1.03,0.97,1.1,0.9,1.013,0.987,1.07,0.93",
    "cells.measured.darks=0.01,-0.01,0.003,0.007,-0.002,0.0,0.011,0.009",
    "gyro.measured.bias_deg_h=12.3,-4.5,6.7",
    "magnetometer.measured.bias_nt=120.0,-35.0,77.0",
    "magnetometer.measured.matrix=1.02,0.003,-0.004,0.003,0.97,0.011,-0.004,0.011,1.013",
)
VARIANTS = {
    "each case has its own Earth": ("css_array.albedo.draw=per_cell",),
    "cells with every error": (
        "css_array.noise=0.02",
        "css_array.scale_common_error=0.1",
        "css_array.scale_cell_error=0.1",
        "css_array.misalignment_deg=1.0",
        "css_array.bias=0.01",
        "css_array.bits=12",
        "css_array.degradation_mode=per_cell",
        "css_array.random_faults.count=2",
        "css_array.random_faults.kind=mixed",
        "css_array.random_faults.time=5.0",
        "css_array.faults=1 noisy 0.2",
    ),
    "dispersed spacecraft with disturbances": (
        "dynamics.dispersion.inertia=0.05",
        "dynamics.dispersion.wheel_torque=0.1",
        "dynamics.substeps=2",
        "dynamics.disturbances.gravity_gradient=true",
        "dynamics.disturbances.dipole=0.5,-0.2,1.0",
        "dynamics.dispersion.dipole=0.3",
        "gyro.bias_walk_deg_s=0.001",
    ),
    "rods that take the wheels' momentum": (
        RODS,
        "rods.fitted=true",
        "magnetometer.divider=3",
        "mrp_control.dumping.enabled=true",
        "dynamics.initial.wheel_speed_rpm=2000",
    ),
    "a spin about the Sun line, and a momentum that the wheels keep": (
        RODS,
        "rods.fitted=true",
        "mrp_control.dumping.enabled=true",
        "mrp_control.dumping.momentum=0.1,0.0,-0.2",
        "mrp_control.reference.spin_deg_s=1.5",
        "mrp_control.reference.acceleration_deg_s2=0.2",
        "mrp_control.reference.known_torque=0.001,0.0,0.0",
    ),
    "a dispersed orbit, integrated for the truth alone": (
        "css_array.albedo.draw=per_cell",
        "dynamics.orbit.model=j2_integrated",
        "mission.epoch_spread_days=365.0",
        "dynamics.dispersion.orbit.altitude=500.0",
        "dynamics.dispersion.orbit.inclination_deg=0.1",
        "dynamics.dispersion.orbit.raan_deg=10.0",
        "dynamics.dispersion.orbit.true_anomaly_deg=20.0",
        "ekf.eclipse.source=model",
    ),
    "wheels that rub, and tachometers that do not say all": (
        RODS,
        "rods.fitted=true",
        "mrp_control.dumping.enabled=true",
        "dynamics.initial.wheel_speed_rpm=20",
        "dynamics.friction.coulomb=0.0005",
        "dynamics.friction.viscous=0.00002",
        "dynamics.dispersion.friction=0.2",
        "dynamics.tachometer.resolution_rpm=1.0",
        "dynamics.tachometer.noise_rpm=2.0",
    ),
    "wheels and tachometers that fail, found and flown without": (FAILING_WHEELS,),
    "the same, and nobody looks for them": (
        FAILING_WHEELS,
        "mrp_control.health.enabled=false",
    ),
    "late sensors": (
        "css_array.latency=0.1",
        "gyro.latency=0.27",
        "gyro.latency_spread=0.2",
    ),
    "clouds that move": (
        "css_array.albedo.draw=per_cell",
        "css_array.albedo.drift_m_s=100.0",
        "css_array.albedo.drift_spread_m_s=20.0",
        "css_array.albedo.renewal_h=0.02",
    ),
    "readings that a calibration corrects": (
        "css_array.bias=0.01",
        "css_array.scale_cell_error=0.1",
        "css_array.misalignment_deg=1.0",
        *CALIBRATED,
    ),
    "nobody controls": ("graph.nodes=css_sim/dynamics,css_sim/css_array,css_sim/gyro,css_estimation/ekf",),
    "without albedo, eclipse from the model": ("css_array.albedo.enabled=false", "ekf.eclipse.source=model"),
}


def same_steps(mission):
    """Flies the cases both ways; how many steps were compared."""
    trace = fly_cases(MissionFlight(mission), CASES, 10, traced=True).trace
    for case, flown in zip(CASES, trace, strict=True):
        log = fly_directly(mission.with_overrides([f"mission.case={case}"]))
        truth, estimate = log.having("truth"), log.estimates[mission.values.graph.estimator]
        expected = [truth.sigma_bn, truth.omega_bn_b, estimate.sun_b, estimate.omega_bn_b]
        if log.rod_command is not None:
            expected.append(log.rod_command.dipole)
        if log.wheels is not None:
            speed = log.wheels.speed
            expected += [np.zeros_like(speed) if log.torque_command is None else log.torque_command.torque, speed]
        np.testing.assert_array_equal(flown, np.hstack(expected))
    return trace.shape[1]


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_step_is_the_same(variant):
    mission = load_mission("okeefe_2013").with_overrides(["mission.duration=20.0", *VARIANTS[variant]])
    assert same_steps(mission) == 200


@pytest.mark.parametrize("estimator", anywhere(SunEstimator))
@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_every_estimator_is_the_same(estimator, gyro):
    mission = configured(load_mission("okeefe_2013"), estimator=estimator, gyro=gyro)
    assert same_steps(mission.with_overrides(["mission.duration=20.0"])) == 200


@pytest.mark.parametrize("gyro", [True, False], ids=["gyro", "no gyro"])
def test_a_calibration_of_cells_is_the_same_as_far_as_into_its_manoeuvre(gyro):
    mission = configured(load_mission("okeefe_calibration"), gyro=gyro)
    assert same_steps(mission.with_overrides(["mission.duration=360.0"])) == 3600


RODS_ALONE = {
    "detumbling": (),
    "in the shadow": ("orbit.true_anomaly_deg=180.0",),
    "slow enough for the spin": ("dynamics.initial.rate_deg_s=2.0", "magnetic_control.law=spin"),
    "detumbling alone": ("dynamics.initial.rate_deg_s=2.0", "magnetic_control.law=detumble"),
    "the rate of the estimator": (
        "dynamics.initial.rate_deg_s=2.0",
        "magnetic_control.rate_from=estimator",
    ),
    "late sensors": ("magnetometer.latency=0.6", "css_array.latency=0.25", "css_array.latency_spread=0.1"),
    "a rate by a field that a calibration corrects": (
        "dynamics.initial.rate_deg_s=2.0",
        "cells.measured.scales=1.03,0.97,1.1,0.9,1.013,0.987",
        "magnetometer.measured.bias_nt=120.0,-35.0,77.0",
        "magnetometer.measured.matrix=1.02,0.003,-0.004,0.003,0.97,0.011,-0.004,0.011,1.013",
    ),
    "no rest, a field at every cycle": ("magnetometer.divider=1", "magnetic_control.rest_before_measurement=false"),
}


@pytest.mark.parametrize("variant", RODS_ALONE)
@pytest.mark.parametrize("name", [name for name in MISSIONS if controlled_by(name, MagneticControl)])
def test_torque_rods_alone_are_the_same(name, variant):
    mission = load_mission(name, ["mission.duration=60.0", *RODS_ALONE[variant]])
    estimator = mission.node(mission.values.graph.estimator)
    if "rate" in variant and "rate.use_field" in estimator.canonical:
        mission = mission.with_overrides([f"{estimator.name}.rate.use_field=true"])
    assert same_steps(mission) == 240
    log = fly_directly(mission)
    assert np.any(log.having("rod_command").dipole)


def test_rods_rest_the_same_while_the_magnetometer_is_off():
    events = "events: {off: {time: 20.0, node: magnetometer, action: deactivate}, on: {time: 30.0, node: magnetometer, "
    text = f"extends: cubesat_3u_safe, mission: {{duration: 60.0}}, {events}action: activate}}}}"
    mission = mission_from_text(f"/**: {{ros__parameters: {{{text}}}}}", "scripted")
    assert same_steps(mission) == 240
    dipoles = np.any(fly_directly(mission).having("rod_command").dipole, axis=1)
    # the last measurement counts until the next is due; two make a pair again
    assert np.any(dipoles[60:80]) and not np.any(dipoles[80:124]) and np.any(dipoles[124:])


# sunrise after two minutes, and gains that then find the Sun in one
SUNRISE = (
    "orbit.true_anomaly_deg=43.0",
    "mission.duration=300.0",
    "mrp_control.gains.k=0.148",
    "mrp_control.gains.p=0.9",
)
CLARK = {
    "flat cells": ("clark_1996_flat", (), {MODE_SHADOW, MODE_FLAT}),
    "pyramid": ("clark_1996_pyramid", (), {MODE_SHADOW, MODE_FLAT, MODE_PYRAMID}),
    "a slower magnetometer, dumping at all times": (
        "clark_1996_pyramid",
        ("magnetometer.divider=4", "mrp_control.dumping.when=always"),
        {MODE_SHADOW, MODE_FLAT, MODE_PYRAMID},
    ),
    "light by patches": ("clark_1996_flat", ("css_array.albedo.model=patches",), {MODE_SHADOW, MODE_FLAT}),
    "light from nadir": (
        "clark_1996_flat",
        ("css_array.albedo.model=nadir", "css_array.albedo.reflectivity=constant"),
        {MODE_SHADOW, MODE_FLAT},
    ),
    "a vector of each case's own Earth": (
        "clark_1996_flat",
        ("css_array.albedo.reflectivity=zonal", "css_array.albedo.draw=per_cell"),
        {MODE_SHADOW, MODE_FLAT},
    ),
}


@pytest.mark.parametrize("variant", CLARK)
def test_safe_hold_is_the_same_from_the_shadow_into_the_sun(variant):
    name, overrides, modes = CLARK[variant]
    mission = load_mission(name, [*SUNRISE, *overrides])
    assert same_steps(mission) == 600
    log = fly_directly(mission)
    estimate = log.estimates[mission.values.graph.estimator]
    assert modes <= set(estimate.mode.tolist())
    assert SunEstimate.RATE_FIELD in estimate.rate_source
    assert not log.sunlit[0] and log.sunlit[-1]


def test_the_same_over_several_blocks_and_scripted_changes():
    events = """
    events:
      off: {time: 100.04, node: gyro, action: deactivate}
      tuned: {time: 130.0, node: ekf, action: set, parameter: cell_sigma, value: 0.2}
      failed: {time: 135.0, node: css_array, action: set, parameter: faults, value: ['2 dead']}
      on: {time: 140.0, node: gyro, action: activate}
    """
    mission = mission_from_text(
        f"/**:\n  ros__parameters:\n    extends: okeefe_2013\n    mission: {{duration: 150.0}}{events}", "scripted"
    )
    assert same_steps(mission) == 1500 > BLOCK_STEPS


REFUSED = {
    "another event": (
        "/**: {ros__parameters: {extends: okeefe_2013, "
        "events: {a: {time: 1.0, node: mrp_control, action: deactivate}}}}",
        "scripted: events.a: the compiled loop switches sensors alone, here gyro",
    ),
    "two gyros": (
        "/**: {ros__parameters: {extends: okeefe_2013, "
        "graph: {nodes: [css_sim/dynamics, css_sim/css_array, css_sim/css_array:two, "
        "css_sim/gyro, css_estimation/ekf, sunpoint_control/mrp_control]}}}",
        "two",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_loop_has_no_place_for_is_named(case):
    text, reason = REFUSED[case]
    with pytest.raises(MissionError) as error:
        MissionFlight(mission_from_text(text, "scripted"))
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_a_sun_estimator_beside_the_one_that_controls_has_no_place():
    nodes = "css_sim/dynamics,css_sim/css_array,css_estimation/ekf,css_estimation/wavg,sunpoint_control/mrp_control"
    mission = load_mission("okeefe_2013").with_overrides([f"graph.nodes={nodes}"])
    with pytest.raises(NoPlace, match="wavg does not control"):
        MissionFlight(mission, "wavg")
