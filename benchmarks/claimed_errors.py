# SPDX-License-Identifier: Apache-2.0
"""How far `ekf` errs beyond what it claims while it finds the Sun, without a fault and with a cell that dies meanwhile.

For each flight: time [s] with an error above 10 deg and three of the reported sigmas; the same if, where the cells
together have a settled direction that contradicts the estimate, the covariance covered the difference; steps in which
that would change the covariance. Run where `./sunpoint shell` runs.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from css_analysis.estimate_errors import heading_errors, heading_sigmas
from css_common.component import Outgoing, Received
from css_common.mission import load_mission
from css_estimation.health.cell_memory import PHASE_SETTLED
from css_estimation.sun.sun_estimator import SunEstimator
from css_monte_carlo.direct_flight import fly_checked

BEGIN_S, DURATION_S, LARGE_DEG, GATE = 5.0, 150.0, 10.0, 3.5
BASE = (
    f"mission.duration={DURATION_S:g}",
    "css_array.scale_cell_error=0.02",
    "css_array.misalignment_deg=1",
    "css_array.noise=0.005",
)
_LASTING = np.radians(3.0) ** 2  # [rad^2] `health.cells.heading_deg`
_tracks: list[tuple[float, ...]] = []
_cycle = SunEstimator.cycle


def _noting(self: SunEstimator, stamp_ns: int, received: Received) -> Outgoing:
    out = _cycle(self, stamp_ns, received)
    track = self._state.cells.track
    _tracks.append((track.phase, *track.sun_b, *track.covariance))
    return out


def measured(case: int, cell: int | None) -> tuple[float, float, int]:
    """Time beyond the claim, the same with the difference covered, and steps with another covariance."""
    fault = (
        () if cell is None else (f"faults.it.target=cell.{cell}", "faults.it.kind=dead", f"faults.it.time={BEGIN_S:g}")
    )
    _tracks.clear()
    log = fly_checked(load_mission("okeefe_2013", [f"mission.case={case}", *BASE, *fault]))
    _, sigmas = heading_sigmas(log, "ekf")
    steps, errors = (column[-len(sigmas) :] for column in heading_errors(log, "ekf"))
    tracks = np.array(_tracks)[steps]
    cosines = np.sum(log.estimates["ekf"].sun_b[steps] * tracks[:, 1:4], axis=1)
    apart = np.arccos(np.clip(cosines, -1.0, 1.0))
    variance = sigmas**2 + 0.5 * tracks[:, [4, 7, 9]].sum(axis=1) + _LASTING
    contradicts = (tracks[:, 0] == PHASE_SETTLED) & (apart > GATE * np.sqrt(variance))
    covered = np.where(contradicts, np.sqrt(sigmas**2 + apart**2), sigmas)
    large = errors > np.radians(LARGE_DEG)
    if cell is not None:
        large &= steps * log.period > BEGIN_S
    beyond, still = (float((large & (errors > 3.0 * claimed)).sum()) * log.period for claimed in (sigmas, covered))
    return beyond, still, int(contradicts.sum())


def lines(healthy: int, faulted: int) -> Iterator[str]:
    """A line for each flight, and one for each sum."""
    plans: dict[str, list[tuple[int, int | None]]] = {"healthy": [(case, None) for case in range(healthy)]}
    plans["dead"] = [(case, cell) for case in range(faulted) for cell in (0, 1)]
    for label, flights in plans.items():
        results = []
        for case, cell in flights:
            results.append(measured(case, cell))
            name = "no fault" if cell is None else f"cell {cell} dead"
            yield f"case {case}, {name}: {results[-1][0]:.1f} s, {results[-1][1]:.1f} s covered, {results[-1][2]} steps"
        beyond, still, changed = np.array(results).T if results else np.zeros((3, 1))
        long = int((beyond >= 30.0).sum())
        sums = f"{beyond.sum():.0f} s, {still.sum():.0f} s covered, {changed.sum():.0f} steps"
        yield f"{label}: {sums}, {long} longer than 30 s"


def main() -> None:
    """Prints the lines."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--healthy", type=int, default=30, help="flights without a fault")
    parser.add_argument("--faulted", type=int, default=6, help="cases with cell 0 dead, and as many with cell 1")
    options = parser.parse_args()
    SunEstimator.cycle = _noting  # type: ignore[method-assign]
    for line in lines(options.healthy, options.faulted):
        print(line, flush=True)


if __name__ == "__main__":
    main()
