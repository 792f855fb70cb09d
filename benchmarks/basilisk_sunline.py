# SPDX-License-Identifier: Apache-2.0
"""The two unscented Sun filters beside Basilisk's, on the same outputs of the same cells.

    ./sunpoint shell -c "python benchmarks/basilisk_sunline.py"

Eight cells of cosine law with white noise, on a body at a constant rate. Both sides begin with the same state and
covariance, and have the same points, noises and threshold. For each pair and scene it prints the largest difference of
states and of covariances with points used `alike`, and the mean errors of Basilisk, of the filter here with points used
alike, and with points used as by `default`. README: what differs, and why.
"""

import argparse
import json
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from css_bringup.basilisk import Basilisk
from css_common.attitude import rotation_vector_to_dcm
from css_common.schema import default_values
from css_common.vectors import angle_between, multiply, scale
from css_estimation.sun import sunline_suekf, sunline_ukf
from css_estimation.sun.sun_heading import UNAIDED
from css_sensors.cells import CELLS

HOME = Path(__file__).parents[1]
PERIOD = 0.5  # [s]
CELL_SIGMA = 0.017
DIRECTION_NOISE, RATE_NOISE, LIGHT_NOISE = 1e-3, 1e-4, 1e-4  # 1 sigma a cycle
THRESHOLD = 0.0
SETTLED = 100  # cycles
PEERS = {"sunlineUKF": sunline_ukf, "sunlineSuKF": sunline_suekf}
SCENES = {
    "Sun at rest": (0.0, 0.0, 0.0),
    "slow turn": (2e-3, -1e-3, 2e-3),
    "turn through b1 and b2": (0.0, 0.0, 0.02),
    "fast turn": (0.02, -0.03, 0.025),
}


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    basilisk = Basilisk(HOME)
    if not basilisk.installed:
        basilisk.install()
    above = ("largest difference of", "heading error [deg]", "rate error [deg/s]")
    print(" " * 36 + f"{above[0]:^24}{above[1]:^30}{above[2]:^30}")
    columns = ("state", "covariance", *("Basilisk", "alike", "default") * 2)
    widths = (12, 12, *(10,) * 6)
    print(" " * 36 + "".join(f"{column:>{width}}" for column, width in zip(columns, widths, strict=True)))
    for name, omega in SCENES.items():
        for line in compared(basilisk, name, Scene(omega, options.cycles, options.seed)):
            print(line)
    return 0


class Scene:
    """A Sun seen from a turning body."""

    def __init__(self, omega, cycles: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        self.normals = np.array(corners) / math.sqrt(3.0)
        sun_b = (0.8, 0.0, 0.6) if omega[0] else (1.0, 0.0, 0.0)
        if not any(omega):
            sun_b = (0.48, 0.6, 0.64)
        self.sun, self.omega = np.zeros((cycles, 3)), np.zeros((cycles, 3))
        self.first = sun_b
        for k in range(cycles):
            sun_b = multiply(rotation_vector_to_dcm(scale(PERIOD, omega)), sun_b)
            self.sun[k], self.omega[k] = sun_b, omega
        light = np.maximum(self.sun @ self.normals.T, 0.0)
        self.voltages = np.where(light > 0.0, light + CELL_SIGMA * rng.normal(size=light.shape), 0.0)

    def settings(self, name: str) -> dict[str, Any]:
        """What both filters of a pair begin with."""
        started = np.add(self.first, (0.05, -0.1, 0.1)).tolist()
        if name == "sunlineSuKF":
            started = (np.array(started) / np.linalg.norm(started)).tolist()
        rate = [0.0, 0.0, 1.0] if name == "sunlineSuKF" else [0.0, 0.0, 0.0]
        d, r, last = DIRECTION_NOISE**2, RATE_NOISE**2, LIGHT_NOISE**2 if name == "sunlineSuKF" else RATE_NOISE**2
        return {
            "x": started + rate,
            "covariance": np.diag([0.1, 0.1, 0.1, 0.002, 0.002, 0.002]).tolist(),
            "noise": [d, d, d, r, r, last],
            "alpha": 0.02, "beta": 2.0, "kappa": 0.0,
            "cell_variance": CELL_SIGMA**2,
            "threshold": THRESHOLD,
        }  # fmt: skip


def compared(basilisk: Basilisk, name: str, scene: Scene) -> Iterator[str]:
    """A line for each filter."""
    sequence = {
        "normals": scene.normals.tolist(),
        "voltages": scene.voltages.tolist(),
        "period": PERIOD,
        "filters": {peer: scene.settings(peer) for peer in PEERS},
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sequence.json"
        file.write_text(json.dumps(sequence), encoding="utf-8")
        theirs = basilisk.run(HOME / "benchmarks" / "basilisk_sunline_peer.py", file)
    for peer, algorithm in PEERS.items():
        settings = scene.settings(peer)
        x, covariance = followed(algorithm, scene, settings, alike=True)
        default, _ = followed(algorithm, scene, settings, alike=False)
        their_x = np.array(theirs[peer]["states"])
        their_covariance = np.array(theirs[peer]["covariances"]).reshape(-1, 6, 6)
        differences = (np.abs(x - their_x).max(), np.abs(covariance - their_covariance).max())
        heading, rate = zip(*(errors_of(peer, scene, states) for states in (their_x, x, default)), strict=True)
        numbers = "".join(f"{d:12.1e}" for d in differences) + "".join(f"{e:10.4f}" for e in (*heading, *rate))
        yield f"{name:24}{peer:12}{numbers}"


def followed(algorithm, scene: Scene, settings: dict[str, Any], *, alike: bool) -> tuple[np.ndarray, np.ndarray]:
    """States and covariances after every cycle, here; `alike`: with points as Basilisk uses them."""
    p = parameters(algorithm, scene, settings, alike)
    memory, state = algorithm.initial_memory(p), algorithm.initial_state(p)
    memory.x[:], memory.root[:] = settings["x"], np.linalg.cholesky(settings["covariance"])
    state = state._replace(started=True)
    states, covariances = [], []
    for voltages in scene.voltages:
        state, _ = algorithm.step(p, state, memory, PERIOD, voltages, UNAIDED)
        states.append(memory.x.copy())
        covariances.append(memory.root @ memory.root.T)
    return np.array(states), np.array(covariances)


def parameters(algorithm, scene: Scene, settings: dict[str, Any], alike: bool) -> Any:
    """The settings in this project's terms: noises for a second."""
    share = 1.0 / math.sqrt(PERIOD)
    light = {"light_process_sigma": LIGHT_NOISE * share} if algorithm is sunline_suekf else {}
    values = default_values(
        CELLS + algorithm.PARAMETERS,
        cells__normals=scene.normals.ravel().tolist(),
        cells__clip_normal=[0.0, 0.0, 0.0],
        cells__field_of_view_deg=180.0,
        gate_kind="absolute",
        gate=THRESHOLD,
        minimum_output=THRESHOLD,
        cell_sigma=CELL_SIGMA,
        process_sigma=DIRECTION_NOISE * share,
        rate_process_sigma=RATE_NOISE * share,
        points__alpha=settings["alpha"],
        points__beta=settings["beta"],
        points__kappa=settings["kappa"],
        points__redraw=not alike,
        points__centre=alike,
        **light,
    )
    return algorithm.parameters(values)


def errors_of(peer: str, scene: Scene, x: np.ndarray) -> tuple[float, float]:
    """Mean errors of heading [deg] and of the rate across the Sun line [deg/s] once settled."""
    d = x[:, :3] / np.linalg.norm(x[:, :3], axis=1, keepdims=True)
    across = scene.omega - np.sum(scene.omega * scene.sun, axis=1, keepdims=True) * scene.sun
    if peer == "sunlineUKF":
        rate = np.cross(x[:, 3:], x[:, :3]) / np.sum(x[:, :3] ** 2, axis=1, keepdims=True)
        rate_error = np.linalg.norm(rate - across, axis=1)
    else:
        # which of its axes a filter uses its state does not say
        rate_error = np.abs(np.linalg.norm(x[:, 3:5], axis=1) - np.linalg.norm(across, axis=1))
    pairs = zip(d[SETTLED:].tolist(), scene.sun[SETTLED:].tolist(), strict=True)
    heading = [angle_between(tuple(a), tuple(b)) for a, b in pairs]
    return math.degrees(np.mean(heading)), math.degrees(np.mean(rate_error[SETTLED:]))


if __name__ == "__main__":
    raise SystemExit(main())
