# SPDX-License-Identifier: Apache-2.0
"""Both Sun models where the world is not as the filter has it, with white errors alone and with lasting ones."""

from collections.abc import Callable
from typing import NamedTuple

from css_common.mission import Mission
from css_monte_carlo.chunk import fly_in_threads
from css_monte_carlo.mission_flight import MissionFlight
from css_papers.digregorio.flights import FILTERS

_ALBEDO = "css_array.albedo.enabled=true"
_OTHER_FIELD = ("magnetometer.bias_nt=100", *(f"{name}.reference.field_degree=6" for name in FILTERS))
WORLDS = {
    "no light of the Earth": (),
    "light of the Earth": (_ALBEDO,),
    "1.5 times as bright": (_ALBEDO, "css_array.albedo.factor=1.5"),
    "model of Knocke": (_ALBEDO, "css_array.albedo.reflectivity=knocke"),
    "clouds, each 5 deg cell drawn": (_ALBEDO, "css_array.albedo.draw=per_cell"),
    "magnetometer 100 nT off, field to degree 6": (_ALBEDO, *_OTHER_FIELD),
}
"""What the truth is, and how well the filters know the field; their Earth is the zonal one."""

UNKNOWN = "clouds, each 5 deg cell drawn"
"""A world that the filters' models do not hold: light from elsewhere than the mean Earth has it."""

_ERROR_MODELS = ("lasting", "white")
_HOURS = range(0, 24, 4)


class Judged(NamedTuple):
    """One filter in one world, once settled."""

    mean: float  # [deg]
    nees: float  # of the attitude, 3 if consistent
    largest: float  # [deg]


def judge(
    mission: Mission, world: str, cases: int, progress: Callable[[int, int], None] | None = None
) -> dict[tuple[str, str], Judged]:
    """Both filters with both error models, by names.

    Cases are spread over the hours of a day: the Earth turns below the orbit, and what a field model leaves out is a
    matter of place.

    Args:
        cases: at each hour.
    """
    kinds = [(name, errors) for name in FILTERS for errors in _ERROR_MODELS]
    sums = {kind: [0.0, 0.0, 0.0, 0.0] for kind in kinds}
    for done, hour in enumerate(_HOURS):
        epoch = f"mission.epoch={mission.values.mission.epoch[:10]}T{hour:02d}:00:00Z"
        flights = [
            MissionFlight(mission.with_overrides([*WORLDS[world], epoch, f"{name}.error_model={errors}"]), name)
            for name, errors in kinds
        ]
        for kind, tallies in zip(kinds, fly_in_threads(flights, cases), strict=True):
            totals, of_kind = tallies.totals, sums[kind]
            for k, quantity in enumerate(("error_sum", "nees3_sum", "settled")):
                of_kind[k] += float(totals[quantity].sum())
            of_kind[3] = max(of_kind[3], float(totals["error_max"].max()))
        if progress is not None:
            progress(done + 1, len(_HOURS))
    return {kind: Judged(error / steps, nees / steps, largest) for kind, (error, nees, steps, largest) in sums.items()}
