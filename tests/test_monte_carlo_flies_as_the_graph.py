# SPDX-License-Identifier: Apache-2.0
"""What the compiled loop proves holds for the flight graph: the same numbers at every step, to the last bit."""

import numpy as np
import pytest
from flights import fly_composed
from listing import MISSIONS, anywhere, controlled_by, estimators_by_mission

from css_analysis.configured_mission import configured
from css_analysis.flight_log import read_flight
from css_common.drawn_mission import drawn
from css_common.mission import find_mission, load_mission, mission_from_text
from css_estimation.sun.sun_estimator import SunEstimator
from css_monte_carlo.chunk import fly_cases
from css_monte_carlo.mission_flight import MissionFlight
from css_msgs.msg import SunEstimate
from sunpoint_control.nodes.magnetic_control import MagneticControl

EVENTS = """
    events:
      gyro_off: {time: 20.0, node: gyro, action: deactivate}
      gyro_on: {time: 45.0, node: gyro, action: activate}
"""
# The flight begins in the shadow and leaves it after 31 s, while the gyro is off.
OVERRIDES = ["mission.duration=60.0", "orbit.true_anomaly_deg=269.75"]
CASE = 7
# Everything that makes the truth harder at once, while the gyro comes and goes.
HARDER = """
/**:
  ros__parameters:
    extends: okeefe_sun_filter
    mission: {epoch_spread_days: 365.0, duration: 60.0, case: 7}
    orbit: {j2: true}
    events:
      gyro_off: {time: 20.0, node: gyro, action: deactivate}
      gyro_on: {time: 45.0, node: gyro, action: activate}
dynamics:
  ros__parameters:
    orbit: {model: j2_integrated}
    dispersion: {orbit: {altitude: 100.0, raan_deg: 0.5, true_anomaly_deg: 0.5}, friction: 0.2}
    friction: {coulomb: 0.0005, viscous: 0.000005}
    tachometer: {resolution_rpm: 1.0, noise_rpm: 0.5}
css_array:
  ros__parameters:
    albedo: {draw: correlated, drift_m_s: 50.0, drift_spread_m_s: 5.0, renewal_h: 0.02}
    latency: 0.1
gyro:
  ros__parameters: {latency: 0.25, latency_spread: 0.1}
"""
FLOWN = estimators_by_mission(SunEstimator)
SAFE_HOLD = [(name, estimator) for name in FLOWN if name.startswith("clark") for estimator in FLOWN[name]]
RODS_ALONE = [name for name in MISSIONS if controlled_by(name, MagneticControl)]


def trace_of_log(log, estimator):
    """(steps, columns) of a recorded flight in the order of the loop's trace."""
    truth, estimates = log.having("truth"), log.estimates[estimator]
    columns = [truth.sigma_bn, truth.omega_bn_b, estimates.sun_b, estimates.omega_bn_b]
    if log.rod_command is not None:
        columns.append(log.rod_command.dipole)
    if log.wheels is not None:
        columns += [log.having("torque_command").torque, log.wheels.speed]
    return np.hstack(columns)


@pytest.mark.parametrize("estimator", anywhere(SunEstimator))
def test_every_step_of_a_case_equals_that_of_the_composed_graph(estimator, tmp_path):
    text = find_mission("okeefe_2013").read_text().replace("    criteria:", EVENTS + "    criteria:")
    mission = mission_from_text(text, "scripted", OVERRIDES)
    flown = configured(mission, case=CASE, estimator=estimator)
    fly_composed(flown, tmp_path / "bag")
    log = read_flight(tmp_path / "bag")
    estimates = log.estimates[estimator]
    assert not log.sunlit[0] and log.sunlit[-1]

    flight = MissionFlight(configured(mission, estimator=estimator))
    trace = fly_cases(flight, np.array([3, CASE, 9]), 10, traced=True).trace[1]
    np.testing.assert_array_equal(trace, trace_of_log(log, estimator))
    assert len(trace) == 600
    sources = np.unique(estimates.rate_source)
    assert len(sources) == 3, "the flight has steps with gyro, with rates from the Sun and without any"


@pytest.mark.parametrize(("name", "estimator"), SAFE_HOLD)
def test_safe_hold_with_magnetometer_and_rods_equals_the_composed_graph(name, estimator, tmp_path):
    """From the shadow, where the rods work, past sunrise."""
    mission = load_mission(name, ["mission.duration=150.0", "orbit.true_anomaly_deg=43.0"])
    fly_composed(configured(mission, case=CASE), tmp_path / "bag")
    log = read_flight(tmp_path / "bag")
    estimates = log.estimates[estimator]
    assert not log.sunlit[0] and log.sunlit[-1]
    assert np.any(log.having("control").dumping)
    assert SunEstimate.RATE_FIELD in estimates.rate_source

    trace = fly_cases(MissionFlight(mission), np.array([CASE]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of_log(log, estimator))
    assert len(trace) == 300


@pytest.mark.parametrize("name", RODS_ALONE)
def test_torque_rods_without_wheels_and_gyro_equal_the_composed_graph(name, tmp_path):
    """From slow tumbling into the spin, with a magnetometer that measures every few cycles."""
    mission = load_mission(name, ["mission.duration=60.0", "dynamics.initial.rate_deg_s=4.0"])
    fly_composed(configured(mission, case=CASE), tmp_path / "bag")
    log = read_flight(tmp_path / "bag")
    assert log.wheels is None and log.torque_command is None
    assert np.any(log.having("rod_command").dipole)

    trace = fly_cases(MissionFlight(mission), np.array([CASE]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of_log(log, mission.values.graph.estimator))
    assert len(trace) == 240


def test_a_harder_truth_equals_the_composed_graph(tmp_path):
    mission = mission_from_text(HARDER, "harder")
    fly_composed(mission, tmp_path / "bag")
    log = read_flight(tmp_path / "bag")
    trace = fly_cases(MissionFlight(mission), np.array([CASE, 9]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of_log(log, "sun_filter"))
    assert log.true_wheels is not None and not np.array_equal(log.true_wheels.speed, log.having("wheels").speed)
    assert log.epoch_ns == mission.epoch_ns and mission.epoch_ns % 10**9 == 0
    assert len(trace) == 600


CALIBRATED = (
    "css_array.scale_cell_error=0.1",
    "css_array.bias=0.01",
    "cells.measured.scales=1.03,0.97,1.1,0.9,1.013,0.987,1.07,0.93",
    "cells.measured.darks=0.01,-0.01,0.003,0.007,-0.002,0.0,0.011,0.009",
    "gyro.measured.bias_deg_h=12.3,-4.5,6.7",
)


def test_readings_that_a_calibration_corrects_equal_those_of_the_composed_graph(tmp_path):
    mission = load_mission("okeefe_2013", ["mission.duration=60.0", *CALIBRATED])
    fly_composed(configured(mission, case=CASE), tmp_path / "bag")
    trace = fly_cases(MissionFlight(mission), np.array([CASE]), 10, traced=True).trace[0]
    np.testing.assert_array_equal(trace, trace_of_log(read_flight(tmp_path / "bag"), "ekf"))
    assert len(trace) == 600
    uncorrected = load_mission("okeefe_2013", ["mission.duration=60.0", *CALIBRATED[:2]])
    assert not np.array_equal(trace, fly_cases(MissionFlight(uncorrected), np.array([CASE]), 10, traced=True).trace[0])


DISPERSED = (
    "dispersions.dynamics.spacecraft.inertia.each=normal:0.05",
    "dispersions.wheels.max_torque=uniform:0.5",
    "dispersions.cells.field_of_view_deg=uniform:112:125",
    "dispersions.css_array.noise=uniform:0:0.02",
    "dispersions.css_array.albedo.factor=uniform:0.5:1.5",
    "dispersions.css_array.degradation_mode=choice:common:per_cell",
    "dispersions.gyro.bias_deg_h=lognormal:0.5",
    "dispersions.ekf.cell_sigma=normal:0.1",
    "dispersions.mrp_control.gains.k=normal:0.1",
    "dispersions.orbit.altitude=normal:0.1",
)


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_a_dispersed_case_equals_that_of_the_composed_graph(sampling, tmp_path):
    """What a study writes for `fly` flies its cases: draws of truth, sensors and flight software, at every step."""
    design = () if sampling == "random" else (f"sampling.method={sampling}", "sampling.cases=16")
    study = load_mission("okeefe_2013", ["mission.duration=60.0", *DISPERSED, *design])
    fly = mission_from_text(study.text(), "mission.yaml")
    fly_composed(drawn(configured(fly, case=CASE)).mission, tmp_path / "bag")
    trace = fly_cases(MissionFlight(study), np.array([3, CASE]), 10, traced=True).trace
    np.testing.assert_array_equal(trace[1], trace_of_log(read_flight(tmp_path / "bag"), "ekf"))
    assert len(trace[1]) == 600 and not np.array_equal(trace[0], trace[1])
