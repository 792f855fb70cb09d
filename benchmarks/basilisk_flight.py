# SPDX-License-Identifier: Apache-2.0
"""One flight of a Sun-pointing spacecraft in Basilisk, timed.

    .cache/basilisk/bin/python -I benchmarks/basilisk_flight.py scenario.json --albedo --estimator wls

Runs in an environment of its own, which `./sunpoint bench monte-carlo` makes, and knows nothing of Sunpoint but
the scenario it is given: a JSON file whose values are SI units and radians in the names of
`css_bringup.basilisk_scenario`. Modules are Basilisk's own, stepped by one task, dynamics by its RK4. Only the
stepping is timed, in processor time. The last line is a JSON object; `FIGURES` says what is in it.

What Basilisk cannot model: the flattened response of the cells, a loss of output that changes from step to step,
and the body plane that hides half of each cell's view. White noise and lasting losses take the place of the first two.
"""

import argparse
import ctypes
import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import (
    cssWlsEst,
    imuComm,
    mrpFeedback,
    okeefeEKF,
    rateMsgConverter,
    rwMotorTorque,
    sunSafePoint,
)
from Basilisk.simulation import albedo, coarseSunSensor, eclipse, imuSensor, reactionWheelStateEffector, spacecraft
from Basilisk.utilities import RigidBodyKinematics, SimulationBaseClass, macros, simIncludeGravBody, simIncludeRW

FIGURES = {
    "steps": "control cycles flown",
    "cpu_s": "processor time of stepping [s]",
    "heading_error_mean_deg": "estimated to true Sun, sunlit, after SETTLED",
    "heading_known": "share of those seconds in which there was an estimate",
    "pointing": "share of those seconds in which the array normal was within 30 deg of the Sun",
    "albedo_max": "largest reflected light in any cell, as a fraction of full Sun",
}
SETTLED = 120.0  # [s] acquisition takes 55 s at most
CELL_NOISE = 0.017  # [-] 1 sigma
CELL_LOSS = 0.05  # [-] largest lasting loss of a cell
# Between what the Earth can light and what a cell reads at the edge of its view: below it two opposite or several
# coplanar cells count as lit, of which least squares finds no heading.
USE_THRESHOLD = 0.40
MASS = 100.0  # [kg] plays no part


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", type=Path)
    parser.add_argument("--albedo", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--estimator", choices=("wls", "okeefe"), default="wls")
    options = parser.parse_args()
    with silence():
        flight = Flight(json.loads(options.scenario.read_text()), options.albedo, options.estimator)
        result = flight.fly()
    print(json.dumps(result))
    return 0


@contextmanager
def silence() -> Iterator[None]:
    """Drops what Basilisk prints from C, two lines for every singular matrix."""
    sys.stdout.flush()
    kept = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        sys.stdout.flush()
        ctypes.CDLL(None).fflush(None)  # what waits in C's own buffers would come out at the end
        for target, saved in enumerate(kept, 1):
            os.dup2(saved, target)
            os.close(saved)
        os.close(nowhere)


class Flight:
    """The modules of one spacecraft. All are kept as attributes: Basilisk reads freed memory where they are not."""

    def __init__(self, scenario: dict, with_albedo: bool, estimator: str) -> None:
        self.scenario = scenario
        self.random = np.random.default_rng(scenario["seed"])
        self.simulation = SimulationBaseClass.SimBaseClass()
        process = self.simulation.CreateNewProcess("flight")
        process.addTask(self.simulation.CreateNewTask("cycle", macros.sec2nano(scenario["period"])))
        self._environment()
        self._spacecraft()
        self._cells(with_albedo)
        self._gyro()
        self._estimator(estimator)
        self._control()
        self._recorders()

    def fly(self) -> dict:
        """Steps to the end; see `FIGURES`."""
        simulation, scenario = self.simulation, self.scenario
        simulation.InitializeSimulation()
        simulation.ConfigureStopTime(macros.sec2nano(scenario["duration"]))
        began = time.process_time()
        simulation.ExecuteSimulation()
        cpu_s = time.process_time() - began
        return {"steps": round(scenario["duration"] / scenario["period"]), "cpu_s": cpu_s, **self._errors()}

    def _step(self, module, name: str) -> Any:
        """Calls a module once a cycle, after those named before it."""
        module.ModelTag = name
        self.simulation.AddModelToTask("cycle", module)
        return module

    def _environment(self) -> None:
        """Sun and orientation of the Earth as at the middle of the flight.

        Over an orbit the Sun moves by 0.06 deg, and a zonal Earth looks the same however it has turned.
        """
        scenario = self.scenario
        sun = messaging.SpicePlanetStateMsgPayload(PlanetName="sun", PositionVector=scenario["sun_position_n"])
        earth = messaging.SpicePlanetStateMsgPayload(PlanetName="earth", J20002Pfix=scenario["dcm_en"])
        self.sun = messaging.SpicePlanetStateMsg().write(sun)
        self.earth = messaging.SpicePlanetStateMsg().write(earth)

    def _spacecraft(self) -> None:
        scenario = self.scenario
        self.body = spacecraft.Spacecraft()
        hub = self.body.hub
        hub.mHub = MASS
        hub.IHubPntBc_B = scenario["inertia"]
        hub.r_CN_NInit, hub.v_CN_NInit = column(scenario["r_n"]), column(scenario["v_n"])
        hub.sigma_BNInit, hub.omega_BN_BInit = column(scenario["sigma_bn"]), column(scenario["omega_bn_b"])
        self.gravity = simIncludeGravBody.gravBodyFactory()
        self.gravity.createEarth().isCentralBody = True
        self.gravity.addBodiesTo(self.body)
        self.wheel_factory = simIncludeRW.rwFactory()
        for axis in scenario["wheel_axes"]:
            self.wheel_factory.create(
                "custom",
                np.array(axis),
                Js=scenario["wheel_inertia"],
                u_max=scenario["wheel_max_torque"],
                Omega_max=scenario["wheel_max_speed_rpm"],
            )
        self.wheels = reactionWheelStateEffector.ReactionWheelStateEffector()
        self.wheel_factory.addToSpacecraft("wheels", self.wheels, self.body)
        self._step(self.wheels, "wheels")
        self._step(self.body, "body")

    def _cells(self, with_albedo: bool) -> None:
        scenario = self.scenario
        self.shadow = eclipse.Eclipse()
        self.shadow.sunInMsg.subscribeTo(self.sun)
        self.shadow.addSpacecraftToModel(self.body.scStateOutMsg)
        self.shadow.addPlanetToModel(self.earth)
        self._step(self.shadow, "shadow")
        self.reflection = self._reflection() if with_albedo else None
        self.cells = []
        for number, normal in enumerate(scenario["cell_normals"]):
            cell = coarseSunSensor.CoarseSunSensor()
            cell.nHat_B, cell.fov = normal, scenario["cell_half_view"]
            cell.scaleFactor = 1.0 - CELL_LOSS * self.random.uniform()
            cell.senNoiseStd = CELL_NOISE
            cell.minOutput, cell.maxOutput = 0.0, 2.0
            cell.RNGSeed = int(self.random.integers(1, 2**31))  # equal by default, and so would be the noise
            cell.sunInMsg.subscribeTo(self.sun)
            cell.stateInMsg.subscribeTo(self.body.scStateOutMsg)
            cell.sunEclipseInMsg.subscribeTo(self.shadow.eclipseOutMsgs[0])
            if self.reflection:
                cell.albedoInMsg.subscribeTo(self.reflection.albOutMsgs[number])
            self.cells.append(cell)
        self.array = coarseSunSensor.CSSConstellation()
        for cell in self.cells:
            self.array.appendCSS(cell)
        self._step(self.array, "cells")

    def _reflection(self) -> albedo.Albedo:
        reflection = albedo.Albedo()
        reflection.spacecraftStateInMsg.subscribeTo(self.body.scStateOutMsg)
        reflection.sunPositionInMsg.subscribeTo(self.sun)
        file = Path(self.scenario["reflectivity_file"])
        reflection.addPlanetandAlbedoDataModel(self.earth, str(file.parent), file.name)
        for normal in self.scenario["cell_normals"]:
            reflection.addInstrumentConfig(self.scenario["cell_half_view"], normal, [0.0, 0.0, 0.0])
        return self._step(reflection, "reflection")

    def _gyro(self) -> None:
        scenario = self.scenario
        self.gyro = imuSensor.ImuSensor()
        self.gyro.scStateInMsg.subscribeTo(self.body.scStateOutMsg)
        self.gyro.PMatrixGyro = (scenario["gyro_noise"] * np.eye(3)).tolist()
        self.gyro.setAMatrixGyro(np.zeros((3, 3)).tolist())  # white noise, not a walk
        self.gyro.setErrorBoundsGyro([1.0, 1.0, 1.0])
        self.gyro.senRotBias = (scenario["gyro_bias"] * self.random.standard_normal(3)).tolist()
        self.gyro.RNGSeed = int(self.random.integers(1, 2**31))
        self._step(self.gyro, "gyro")
        self.gyro_telemetry = imuComm.imuComm()
        self.gyro_telemetry.dcm_BP = np.eye(3).ravel().tolist()
        self.gyro_telemetry.imuComInMsg.subscribeTo(self.gyro.sensorOutMsg)
        self._step(self.gyro_telemetry, "gyro telemetry")
        self.rate = rateMsgConverter.rateMsgConverter()
        self.rate.imuRateInMsg.subscribeTo(self.gyro_telemetry.imuSensorOutMsg)
        self._step(self.rate, "rate")

    def _estimator(self, name: str) -> None:
        normals = self.scenario["cell_normals"]
        units = [messaging.CSSUnitConfigMsgPayload(nHat_B=normal, CBias=1.0) for normal in normals]
        self.layout = messaging.CSSConfigMsg().write(messaging.CSSConfigMsgPayload(nCSS=len(units), cssVals=units))
        if name == "wls":
            estimator = cssWlsEst.cssWlsEst()
            estimator.useWeights = False
        else:
            estimator = okeefeEKF.okeefeEKF()
            estimator.state = [1.0, 0.1, 0.0]
            estimator.x = estimator.omega = [0.0, 0.0, 0.0]
            estimator.covar = np.eye(3).ravel().tolist()
            estimator.qProcVal, estimator.qObsVal = 0.1**2, CELL_NOISE**2
            estimator.eKFSwitch = 5.0
        estimator.sensorUseThresh = USE_THRESHOLD
        estimator.cssDataInMsg.subscribeTo(self.array.constellationOutMsg)
        estimator.cssConfigInMsg.subscribeTo(self.layout)
        self.estimator = self._step(estimator, "estimator")

    def _control(self) -> None:
        scenario = self.scenario
        self.guidance = sunSafePoint.sunSafePoint()
        self.guidance.sHatBdyCmd = scenario["array_normal"]
        self.guidance.minUnitMag = 0.001
        self.guidance.smallAngle = scenario["deadband"]
        self.guidance.omega_RN_B = [0.0, 0.0, 0.0]
        self.guidance.sunDirectionInMsg.subscribeTo(self.estimator.navStateOutMsg)
        self.guidance.imuInMsg.subscribeTo(self.rate.navRateOutMsg)
        self._step(self.guidance, "guidance")
        inertia = np.ravel(scenario["inertia"]).tolist()
        self.vehicle = messaging.VehicleConfigMsg().write(messaging.VehicleConfigMsgPayload(ISCPntB_B=inertia))
        self.wheel_layout = self.wheel_factory.getConfigMessage()
        self.feedback = mrpFeedback.mrpFeedback()
        self.feedback.K, self.feedback.P, self.feedback.Ki = scenario["k"], scenario["p"], scenario["ki"]
        self.feedback.integralLimit = scenario["integral_limit"]
        self.feedback.guidInMsg.subscribeTo(self.guidance.attGuidanceOutMsg)
        self.feedback.vehConfigInMsg.subscribeTo(self.vehicle)
        self.feedback.rwParamsInMsg.subscribeTo(self.wheel_layout)
        self.feedback.rwSpeedsInMsg.subscribeTo(self.wheels.rwSpeedOutMsg)
        self._step(self.feedback, "feedback")
        self.allocation = rwMotorTorque.rwMotorTorque()
        self.allocation.controlAxes_B = np.eye(3).ravel().tolist()
        self.allocation.rwParamsInMsg.subscribeTo(self.wheel_layout)
        self.allocation.vehControlInMsg.subscribeTo(self.feedback.cmdTorqueOutMsg)
        self._step(self.allocation, "allocation")
        self.wheels.rwMotorCmdInMsg.subscribeTo(self.allocation.rwMotorTorqueOutMsg)

    def _recorders(self) -> None:
        """Once a second, which costs nothing that can be measured."""
        second = macros.sec2nano(1.0)
        self.truth = self._step(self.body.scStateOutMsg.recorder(second), "truth")
        self.estimate = self._step(self.estimator.navStateOutMsg.recorder(second), "estimate")
        self.light = self._step(self.shadow.eclipseOutMsgs[0].recorder(second), "light")
        sources = self.reflection.albOutMsgs if self.reflection else []
        self.reflected = [self._step(message.recorder(second), f"reflected {i}") for i, message in enumerate(sources)]

    def _errors(self) -> dict:
        scenario = self.scenario
        to_sun = np.array(scenario["sun_position_n"]) - self.truth.r_BN_N
        to_sun /= np.linalg.norm(to_sun, axis=1, keepdims=True)
        attitudes = map(RigidBodyKinematics.MRP2C, self.truth.sigma_BN)
        sun_b = np.array([dcm_bn @ sun for dcm_bn, sun in zip(attitudes, to_sun, strict=True)])
        settled = self.truth.times() * macros.NANO2SEC >= SETTLED
        sunlit = settled & (np.array(self.light.illuminationFactor) > 0.5)
        estimate = np.array(self.estimate.vehSunPntBdy)
        known = sunlit & (np.linalg.norm(estimate, axis=1) > 0.0)
        pointing = angle(sun_b[sunlit], np.array(scenario["array_normal"])) < np.radians(30.0)
        errors = np.degrees(angle(sun_b[known], estimate[known]))
        return {
            "heading_error_mean_deg": float(errors.mean()) if errors.size else None,
            "heading_known": float(known.sum() / sunlit.sum()) if sunlit.any() else None,
            "pointing": float(pointing.mean()) if pointing.size else None,
            "albedo_max": max((float(np.max(one.albedoAtInstrument)) for one in self.reflected), default=0.0),
        }


def column(vector: list[float]) -> list[list[float]]:
    """A vector in the form of Basilisk's initial states."""
    return [[value] for value in vector]


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between vectors along the last axis [rad]."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


if __name__ == "__main__":
    sys.exit(main())
