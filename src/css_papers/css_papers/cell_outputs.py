# SPDX-License-Identifier: Apache-2.0
"""What the cells put out: over the incidence of the Sun, and along an orbit at a fixed attitude."""

from typing import NamedTuple

import numpy as np

from css_analysis.cell_outputs import NO_ERRORS, Cells
from css_common.attitude import dcm_to_mrp
from css_common.mission import Mission
from css_common.random_streams import random_key
from css_common.vectors import mat3
from css_environment.mission_environment import MissionEnvironment
from css_sim.initial_conditions import random_attitude

ARRAY = "css_array"
"""Name of the node that simulates the cells in the mission."""
_NO_ALBEDO = f"{ARRAY}.albedo.enabled=false"
_NO_WARP = f"{ARRAY}.warp=false"
_ORBIT_STEP_S = 10.0
_ANGLES_DEG = np.linspace(-90.0, 90.0, 721)


class Response(NamedTuple):
    """Output of one cell over the angle from its normal to the Sun."""

    angle_deg: np.ndarray  # (A,)
    ideal: np.ndarray  # (A,) cosine within the field of view
    warped: np.ndarray  # (A,) Eq. 16
    degraded: np.ndarray  # (A,) the same with the largest degradation


class OrbitOutputs(NamedTuple):
    """Outputs of N cells at T instants of one orbit, cosine response without errors."""

    time_s: np.ndarray  # (T,) since the epoch
    illumination: np.ndarray  # (T,) fraction of the solar disc in view
    direct: np.ndarray  # (T, N) of the Sun alone
    total: np.ndarray  # (T, N) of Sun and Earth

    @property
    def albedo(self) -> np.ndarray:
        """(T, N) of the Earth alone; without warp the outputs add."""
        return self.total - self.direct


def response(mission: Mission) -> Response:
    """Response of one free cell of the mission, the Sun at 1 AU."""
    one_cell = (
        "cells.normals=0,0,1",
        "cells.clip_normal=0,0,0",
        _NO_ALBEDO,
        *(f"{ARRAY}.{error}" for error in NO_ERRORS),
    )
    upright = np.zeros(3)
    place = MissionEnvironment(mission.values, field=False).at(0.0)._replace(solar_flux=1.0, illumination=1.0)
    angle = np.radians(_ANGLES_DEG)
    suns = [(float(x), 0.0, float(z)) for x, z in zip(np.sin(angle), np.cos(angle), strict=True)]

    def curve(*overrides: str) -> np.ndarray:
        cell = Cells(mission, ARRAY, *one_cell, *overrides)
        return np.array([cell.outputs(0.0, place._replace(sun_n=sun), upright)[0] for sun in suns])

    warped = curve()
    loss = mission.node(ARRAY).values.degradation
    return Response(_ANGLES_DEG, curve(_NO_WARP), warped, (1.0 - loss) * warped)


def orbit_outputs(mission: Mission, sigma_bn: np.ndarray | None = None, step_s: float = _ORBIT_STEP_S) -> OrbitOutputs:
    """Outputs along the flight of a mission, at a fixed attitude; by default the array normal is on the Sun."""
    environment = MissionEnvironment(mission.values, field=False)
    time_s = np.arange(0.0, mission.values.mission.duration, step_s)
    places = [environment.at(float(time)) for time in time_s]
    if sigma_bn is None:
        sigma_bn = sun_pointing(places[0].sun_n)
    plain = (_NO_WARP, *(f"{ARRAY}.{error}" for error in NO_ERRORS))
    both, sun_only = Cells(mission, ARRAY, *plain), Cells(mission, ARRAY, *plain, _NO_ALBEDO)

    def outputs(cells: Cells) -> np.ndarray:
        return np.array([cells.outputs(float(t), p, sigma_bn) for t, p in zip(time_s, places, strict=True)])

    illumination = np.array([place.illumination for place in places])
    return OrbitOutputs(time_s, illumination, outputs(sun_only), outputs(both))


def sun_pointing(sun_n) -> np.ndarray:
    """MRP of the attitude with body z on the Sun and body x in the plane of Sun and north pole."""
    third = np.asarray(sun_n)
    second = np.cross((0.0, 0.0, 1.0), third)
    second = -second / np.linalg.norm(second)
    return np.array(dcm_to_mrp(mat3(np.array([np.cross(second, third), second, third]))))


def albedo_peaks(mission: Mission, attitudes: int, step_s: float = 60.0) -> np.ndarray:
    """(attitudes,) largest output of any cell by the Earth's light along the flight, at fixed random attitudes.

    The attitudes are those with which the mission's cases begin.
    """
    seed = mission.values.mission.seed
    environment = MissionEnvironment(mission.values, field=False)
    cells = Cells(mission, ARRAY, _NO_WARP, *(f"{ARRAY}.{error}" for error in NO_ERRORS))
    # a Sun in eclipse does not light the cells, but still the Earth
    places = [
        (float(t), environment.at(float(t))._replace(illumination=0.0))
        for t in np.arange(0.0, mission.values.mission.duration, step_s)
    ]
    return np.array(
        [
            max(float(np.max(cells.outputs(t, place, np.array(random_attitude(random_key(seed, case))))))
                for t, place in places)
            for case in range(attitudes)
        ]
    )  # fmt: skip
