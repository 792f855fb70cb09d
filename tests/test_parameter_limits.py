# SPDX-License-Identifier: Apache-2.0
"""Limits of all parameters: those that are no zero and no power of ten say something, and are stated here once more."""

from listing import components

from css_common.shared_sections import shared_parameters

MEANT = {
    # directions, and parts of the sphere
    (-360.0, 360.0): "orbit.argument_of_perigee_deg orbit.launch.azimuth_deg orbit.raan_deg orbit.true_anomaly_deg "
    "payload.axis_azimuth_deg slits.head_azimuths_deg",
    (-180.0, 360.0): "orbit.launch.longitude_deg",
    (-90.0, 90.0): "orbit.launch.latitude_deg payload.axis_elevation_deg",
    (10.0, 90.0): "orbit.launch.elevation_deg",
    # angles between two directions, errors of one, tilts that a small angle stands for
    (0.0, 180.0): "deadband_deg dispersion.orbit.raan_deg dispersion.orbit.true_anomaly_deg modes.acquire_angle_deg "
    "modes.point_angle_deg nis_gate_below_deg orbit.inclination_deg pyramid.entry_deg",
    (1.0, 180.0): "cells.field_of_view_deg cells.fields_of_view_deg",
    (0.0, 120.0): "payload.coning_angle_deg",
    (0.0, 90.0): "calibration.largest_incidence_deg collar.dark_deg collar.full_deg response.angles_deg",
    (2.5, 90.0): "albedo.correlation_deg",
    (1.0, 89.9): "payload.flat_spin_angle_deg",
    (1.0, 89.0): "rate.field_angle_deg",
    (5.0, 85.0): "slits.inclination_deg",
    (2.0, 179.0): "slits.field_of_view_deg",
    (1.0, 60.0): "search.until_deg",
    (0.0, 45.0): "albedo.unknown_heading_deg coning_prior_deg health.cells.heading_deg health.sight.error_deg "
    "misalignment_deg tilt_sigma_deg",
    (0.1, 45.0): "roll.from_deg",
    (0.0, 30.0): "calibration.alignment_sigma_deg",
    (1.0, 3600.0): "modes.search_angle_deg",
    # rates of a turn a second, ten of them, and what wheels and searches are made for
    (0.0, 3600.0): "initial.max_rate_deg_s initial.rate_deg_s",
    (0.0, 360.0): "measures.detumbled_rate_deg_s modes.detumble_exit_rate_deg_s modes.detumble_rate_deg_s "
    "rate.limit_deg_s",
    (0.1, 90.0): "payload.flat_spin_rate_deg_s",
    (-60.0, 60.0): "reference.spin_deg_s",
    (0.01, 60.0): "line.patience retry spin.rate_deg_s",
    (0.0, 60.0): "health.window reference.acceleration_deg_s2 scan_period",
    (0.01, 2.0): "albedo.largest modes.search_rate_deg_s",
    (0.01, 50.0): "payload.spin_hz",
    (0.002, None): "highest_spin_hz",
    # whole numbers that fit their fields: bits, addresses, ports, seeds, counts of cells and heads
    (0, 31): "health.cells.screened wheels_out",
    (0, 32): "bits random_faults.count",
    (0, 127): "i2c.addresses",
    (0, 255): "i2c.bus inputs spi.bus spi.device",
    (0, 2**16 - 1): "udp.listen",
    (1, 2**16 - 1): "udp.port",
    (0, 2**24): "sampling.cases",
    (0, 2**32 - 1): "cells.blocked mission.case",
    (0, 2**63 - 1): "mission.seed",
    (0, 16): "lockstep.recorders",
    (1, 13): "reference.field_degree",  # of IGRF
    (2, 1000): "modes.debounce",
    # devices
    (0.0, 5.5): "adc128d818.reference mcp3208.reference",
    (10_000, 2_000_000): "spi.clock",
    (1200, 12_000_000): "serial.baud",
    (50, 4_000_000): "line.baud",
    # temperatures and heights
    (-273.15, 1000.0): "cells.measured.temperature",
    (-270.0, 200.0): "thermal.dark_temperature thermal.reference_temperature",
    (0.0, 300.0): "thermal.rise",
    (-500.0, 1e5): "orbit.launch.height",
    (1e3, 2e6): "orbit.launch.apogee",
    # shares and factors: no body has a ratio of inertias above 2, no orbit that closes an eccentricity of 1
    (0.0, 2.0): "health.cells.earth_light inertia_ratio initial_light_sigma initial_rate_sigma initial_sigma "
    "response.outputs",
    (0.0, 0.9): "orbit.eccentricity",
    (0.0, 0.5): "dispersion.wheel_torque health.torque_error",
    (0.0, 0.2): "dispersion.inertia",
    (0.01, 0.95): "answer_within",
    (3.0, 100.0): "health.gyro.sigmas health.sigma",
    (3.0, 1000.0): "largest_condition",
    (-200.0, 200.0): "albedo.drift_m_s",
    # times: a stamp has 2038 as its end
    (0.0, 3.2e8): "mission.duration",
    (0.0, 20000.0): "mission.epoch_spread_days",
    (1e-3, 60.0): "mission.period",
    (0.05, None): "lockstep.warn_after",
    (60.0, 1e6): "health.cells.longest_eclipse",
}
FROM_ONE = (
    "albedo.cloud_angle_deg albedo.cloud_time albedo.scale_time confirmations divider double_delay_us field.error_nt "
    "health.agreement health.cells.gate_sigma health.cells.return_time health.cells.threshold health.field.error_nt "
    "health.field.largest_nt health.field.return_time health.field.threshold health.gyro.memory "
    "health.gyro.return_sigmas health.gyro.return_time health.pause health.returns health.sight.angle_deg "
    "health.sight.time magnetometer.divider nis_gate scale_time substeps tilt_time"
)
"""Names of those that are 1 at least; else the least is 0, another power of ten, or stands above."""


def parameters():
    return [*shared_parameters().values(), *(parameter for kind in components() for parameter in kind.table())]


def is_round(limit):
    return limit is None or limit == 0 or f"{abs(limit):e}".startswith("1.000000e")


def test_limits_are_round_or_the_ones_that_are_meant():
    meant = {name: pair for pair, names in MEANT.items() for name in names.split()}
    found = {(parameter.name, parameter.low, parameter.high) for parameter in parameters()}
    # a node may have its own range for a name that another has too
    special = {(name, low, high) for name, low, high in found if not (is_round(low) and is_round(high))}
    assert special == {(name, *pair) for name, pair in meant.items()}
    assert {name for name, low, _ in found - special if low == 1} == set(FROM_ONE.split())


def test_a_doubled_limit_is_not_round():
    for limit in (1e-6, 0.1, 1.0, 10.0, 1e5):
        assert is_round(limit) and is_round(-limit) and not is_round(2.0 * limit)
    assert not is_round(101) and not is_round(100_001)
