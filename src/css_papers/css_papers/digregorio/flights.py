# SPDX-License-Identifier: Apache-2.0
"""Flights of both filters with each set of diodes, and what they came to."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from css_analysis.flight_metrics import windows_of
from css_common.mission import Mission
from css_monte_carlo.attitude_tallies import SAMPLED, AttitudeTallies
from css_monte_carlo.chunk import fly_in_threads
from css_monte_carlo.mission_flight import MissionFlight

MISSION = "cubesat_vmm"
VECTOR, VOLTAGE = "attitude_vector", "attitude_voltage"
FILTERS = {VECTOR: "vector", VOLTAGE: "voltage"}
AS_IN_PAPER = tuple(f"{name}.{key}" for name in FILTERS for key in ("error_model=white", "albedo.compensate=false"))
"""The filters of the slides: all errors are white noise, and the Earth does not shine."""
GUESS_DEG = 20.0
"""Error of the attitude that filters begin with, about each axis, 1 sigma."""
DIVERGED_DEG = 10.0
"""Mean error [deg] over the last minute beyond which a case has diverged."""

_FACES = "1,0,0,-1,0,0,0,1,0,0,-1,0"
_R = 0.7071067811865476
_PYRAMIDS = ",".join(f"{v}" for z in (_R, -_R) for x, y in ((_R, 0), (0, _R), (-_R, 0), (0, -_R)) for v in (x, y, z))
DIODES = {
    "six": f"cells.normals={_FACES},0,0,1,0,0,-1",
    "five": f"cells.normals={_FACES},0,0,1",
    "four": f"cells.normals={_FACES}",
    "dual pyramid": f"cells.normals={_PYRAMIDS}",
}
"""Sets of diodes: on all faces of a box, none on -z, in a plane, two pyramids of four."""

ERROR, SIGMA, _, LIT = range(len(SAMPLED))


class Merit(NamedTuple):
    """One filter with one set of diodes, all cases, once settled; angles in deg."""

    mean: float
    p95: float
    largest: float
    nees: float  # of the attitude, 3 if consistent
    nis: float  # for each degree of freedom, 1 if consistent
    diverged: int  # cases


class Flown(NamedTuple):
    """All cases of both filters with one set of diodes."""

    merits: dict[str, Merit]
    samples: dict[str, np.ndarray]  # filter to (C, quantities, S), see `attitude_tallies.SAMPLED`
    sample_s: float


def with_noise(sigma: float) -> tuple[str, ...]:
    """Overrides that give diodes and filters another noise [-]."""
    return (f"css_array.noise={sigma}", *(f"{name}.cell_sigma={sigma}" for name in FILTERS))


def fly(
    mission: Mission,
    diodes: str,
    cases: int,
    overrides: tuple[str, ...] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Flown:
    """Flies both filters of the slides on the same data, from the same guess."""
    flown = mission.with_overrides([DIODES[diodes], *AS_IN_PAPER, *overrides])
    period_s = mission.period_ns * 1e-9
    flights = [MissionFlight(flown, name) for name in FILTERS]
    tallies = dict(zip(FILTERS, fly_in_threads(flights, cases, guess_deg=GUESS_DEG, progress=progress), strict=True))
    return Flown(
        {name: _merit(of_filter, period_s, windows_of(mission).settled_time) for name, of_filter in tallies.items()},
        {name: of_filter.samples for name, of_filter in tallies.items()},
        period_s,
    )


def _merit(tallies: AttitudeTallies, period_s: float, settled_s: float) -> Merit:
    totals = tallies.totals
    settled = int(totals["settled"].sum())
    errors = tallies.samples[:, ERROR]
    late = errors[:, int(settled_s / period_s) :]
    last = errors[:, -int(60.0 / period_s) :].mean(axis=1)
    return Merit(
        mean=float(totals["error_sum"].sum() / settled),
        p95=float(np.nanpercentile(late, 95.0)),
        largest=float(totals["error_max"].max()),
        nees=float(totals["nees3_sum"].sum() / settled),
        nis=float(totals["nis_sum"].sum() / totals["innovations"].sum()),
        diverged=int(np.count_nonzero(~(last < DIVERGED_DEG))),
    )
