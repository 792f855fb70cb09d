# SPDX-License-Identifier: Apache-2.0
"""What flies: the spacecraft of O'Keefe & Schaub under clouds that no flight knows, and what may be otherwise."""

from collections.abc import Mapping
from typing import NamedTuple

from css_monte_carlo.study import Configuration
from css_papers.best.layouts import layouts

MISSION = "okeefe_sun_filter"
CALIBRATION = "okeefe_calibration"
CUBESAT = "cubesat_3u_sun_filter"
FILTER = "sun_filter"

# what the filter's mission says of cells and Earth
_CLOUDS = {"css_array.albedo.draw": "per_cell", "css_array.noise": "0.005"}
_UNCALIBRATED = {
    "css_array.scale_cell_error": "0.02",
    "css_array.misalignment_deg": "1",
}
_TOLD = {f"{FILTER}.gain_sigma": "0.02", f"{FILTER}.tilt_sigma_deg": "1"}


# What a truth has that flatters no estimator. The true orbit has the short periods of J2 and elements of its own, the
# flight's drifts evenly; clouds are alike over 15 deg, drift and become others; what is read is a cycle old.
_HARDER = {
    "mission.epoch_spread_days": "365",
    "orbit.j2": "true",
    "dynamics.orbit.model": "j2_integrated",
    "dynamics.dispersion.orbit.altitude": "100",
    "dynamics.dispersion.orbit.inclination_deg": "0.02",
    "dynamics.dispersion.orbit.raan_deg": "0.02",
    "dynamics.dispersion.orbit.true_anomaly_deg": "0.05",
    "css_array.albedo.draw": "correlated",
    "css_array.albedo.drift_m_s": "10",
    "css_array.albedo.drift_spread_m_s": "5",
    "css_array.albedo.renewal_h": "12",
    "css_array.latency": "0.1",
    "gyro.latency": "0.1",
    "dynamics.friction.coulomb": "0.0005",
    "dynamics.friction.viscous": "5e-6",
    "dynamics.dispersion.friction": "0.2",
    "dynamics.tachometer.resolution_rpm": "1",
}
_GRAVITY = {"dynamics.disturbances.gravity_gradient": "true", f"{FILTER}.rate.gravity_gradient": "true"}
_TORQUE = {"dynamics.disturbances.torque": "5.8e-7,5.8e-7,5.8e-7"}
_INTEGRATED = 16.0  # [deg] what such a torque makes of 8 kg m^2 in 35 min of shadow
_PLACE_INTEGRATED = {"orbit.model": "j2_integrated"}


class Scenario(NamedTuple):
    """One line of the page."""

    label: str
    settings: Mapping[str, str]
    error_must: float | None = None  # [deg] largest mean heading error
    estimator: str = FILTER
    side: bool = False  # left out when it must be quick
    mission: str = MISSION
    error: str = "heading_error_mean_deg"  # column of the heading error that is asked for
    eclipse_must: float = 2.0  # [deg] largest mean error in the shadow, where a heading error is asked for
    gyros: tuple[bool, ...] = (True, False)  # flown with and without

    def configuration(self, gyro: bool) -> Configuration:
        """How it flies."""
        return Configuration(self.estimator, gyro, tuple(f"{key}={value}" for key, value in self.settings.items()))


_AFTERWARDS = "heading_error_late_deg"
_LARGEST = {"six faces": 1.0}


def scenarios() -> list[Scenario]:
    """All of the page, in its order."""
    cells = layouts()
    return [
        Scenario("calibrated cells, clouds per case", {}, 0.3),
        _of_the_paper("ekf", "the paper's filter (ekf)", _CLOUDS),
        _of_the_paper("wavg", "the paper's average (wavg)", _CLOUDS),
        Scenario("gains 2 %, tilts 1 deg, uncalibrated", _UNCALIBRATED | _TOLD | _calibrated("consider"), 1.3),
        Scenario("the same, calibrated in flight by a manoeuvre", {}, 0.6, mission=CALIBRATION, error=_AFTERWARDS),
        Scenario(
            "the same, calibrated without a manoeuvre", _UNCALIBRATED | _TOLD | _calibrated("estimate"), side=True
        ),
        Scenario("an Earth 1.5 times as bright again", {"css_array.albedo.factor": "2.25"}, side=True),
        *(_correlated(angle) for angle in (15, 30)),
        Scenario("all clouds in common", {"css_array.albedo.draw": "common"}, side=True),
        Scenario("another model of the Earth", {f"{FILTER}.albedo.reflectivity": "knocke"}, side=True),
        Scenario("place unknown", {f"{FILTER}.use_orbit": "false"}),
        *(_orbit(raan, month) for raan, month in ((0, "03"), (180, "09"), (300, "12"))),
        *(
            Scenario(name, layout.settings, _LARGEST.get(name), side=name != "six faces")
            for name, layout in cells.items()
        ),
        Scenario("gravity's torque, reckoned with", _GRAVITY, 0.3, side=True),
        Scenario("1e-6 N m that nobody knows", _TORQUE, 0.3, side=True, eclipse_must=_INTEGRATED),
        Scenario("3U cubesat, six faces and magnetometer", {}, side=True, mission=CUBESAT, gyros=(False,)),
        Scenario("harder truth", _HARDER),
        Scenario("harder truth, the flight's orbit integrated too", _HARDER | _PLACE_INTEGRATED, side=True),
        _of_the_paper("ekf", "harder truth, the paper's filter (ekf)", _CLOUDS | _HARDER),
        _of_the_paper("ekf", "six faces, the paper's filter (ekf)", _CLOUDS | cells["six faces"].settings),
    ]


def _calibrated(mode: str) -> dict[str, str]:
    """What becomes of gains and tilts in the filter."""
    return {f"{FILTER}.calibration.mode": mode}


def _of_the_paper(estimator: str, label: str, settings: Mapping[str, str]) -> Scenario:
    """An estimator of O'Keefe & Schaub in its own mission, changed to what the filter flies under."""
    return Scenario(label, settings, estimator=estimator, mission="okeefe_2013")


def _orbit(raan: int, month: str) -> Scenario:
    settings = {"orbit.raan_deg": str(raan), "mission.epoch": f"2013-{month}-21T00:00:00Z"}
    return Scenario(f"node at {raan} deg, 21 {_MONTHS[month]}", settings, 0.3, side=True)


def _correlated(angle: int) -> Scenario:
    settings = {"css_array.albedo.draw": "correlated", "css_array.albedo.correlation_deg": str(angle)}
    return Scenario(f"clouds alike over {angle} deg", settings, 0.5, side=angle != 15)


_MONTHS = {"03": "March", "09": "September", "12": "December"}
