# SPDX-License-Identifier: Apache-2.0
"""Basilisk's unscented Sun filters on given outputs of cells; `basilisk_sunline.py` starts it in their environment.

    .cache/basilisk/bin/python -I benchmarks/basilisk_sunline_peer.py sequence.json

Each module is called once a cycle with the message of that cycle. The last line is a JSON object: for each module the
state and the covariance after every cycle.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import sunlineSuKF, sunlineUKF

STATES = 6


def main() -> int:
    """Entry point."""
    sequence = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    filters = sequence["filters"]
    # what the switch filter says of its rates is that of the body relative to n, their covariances are the other way
    turned = np.outer([1, 1, 1, -1, -1, 1], [1, 1, 1, -1, -1, 1])
    of_ukf = followed(ukf(filters["sunlineUKF"]), sequence, np.ones((STATES, STATES)))
    of_sukf = followed(sukf(filters["sunlineSuKF"]), sequence, turned)
    print(json.dumps({"sunlineUKF": of_ukf, "sunlineSuKF": of_sukf}))
    return 0


def ukf(settings: dict) -> Any:
    """Module with its initial state."""
    module = sunlineUKF.sunlineUKF()
    module.state = settings["x"]
    module.covar = np.ravel(settings["covariance"]).tolist()
    return tuned(module, settings)


def sukf(settings: dict) -> Any:
    """The same; its rates are those of the frame relative to the body."""
    module = sunlineSuKF.sunlineSuKF()
    x = np.array(settings["x"])
    x[3:5] *= -1.0
    module.stateInit = module.state = x.tolist()
    module.covarInit = np.ravel(settings["covariance"]).tolist()
    module.filterInitialized = 1
    return tuned(module, settings)


def tuned(module, settings: dict) -> Any:
    """What the two have in common."""
    module.alpha, module.beta, module.kappa = settings["alpha"], settings["beta"], settings["kappa"]
    module.qNoise = np.diag(settings["noise"]).ravel().tolist()
    module.qObsVal = settings["cell_variance"]
    module.sensorUseThresh = settings["threshold"]
    return module


def followed(module, sequence: dict, signs) -> dict:
    """States (cycles, 6) and covariances (cycles, 36), these multiplied by signs."""
    cells = messaging.CSSConfigMsgPayload()
    units = []
    for normal in sequence["normals"]:
        unit = messaging.CSSUnitConfigMsgPayload()
        unit.nHat_B, unit.CBias = normal, 1.0
        units.append(unit)
    cells.nCSS, cells.cssVals = len(units), units
    layout = messaging.CSSConfigMsg().write(cells)
    outputs = messaging.CSSArraySensorMsg()
    module.cssConfigInMsg.subscribeTo(layout)
    module.cssDataInMsg.subscribeTo(outputs)
    module.SelfInit()  # makes the message that it writes
    module.Reset(0)
    states, covariances = [], []
    for k, voltages in enumerate(sequence["voltages"], 1):
        stamp_ns = round(1e9 * k * sequence["period"])
        payload = messaging.CSSArraySensorMsgPayload()
        payload.CosValue = voltages
        outputs.write(payload, stamp_ns)
        module.UpdateState(stamp_ns)
        said = module.filtDataOutMsg.read()
        states.append(list(said.state[:STATES]))
        covariances.append((signs * np.reshape(said.covar[: STATES * STATES], (STATES, STATES))).ravel().tolist())
    return {"states": states, "covariances": covariances}


if __name__ == "__main__":
    raise SystemExit(main())
