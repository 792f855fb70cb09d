# SPDX-License-Identifier: Apache-2.0
"""What follows from what was asked: inertia, orbit, estimator, gains. A mission's numbers, not yet its text."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from css_design.errors import DesignError
from css_design.new_mission.body import Panel, Plates, inertia_of, panels_of, plates_of
from css_design.new_mission.directions import FACES, Vector, direction
from css_design.new_mission.gains import Capacity, Loop, capacity, designed
from css_design.new_mission.items import BY_NAME
from css_design.new_mission.orbits import Orbit, orbit_of
from css_sim.rigid_body import LARGEST_ANGLE
from sunpoint_control.loop_stability import LoopModel

RATE_CUTOFF = 0.1
"""Corner [Hz] of the low-pass on the rate, as estimators and wheel health have it."""

EARTHLIGHT = 0.1
"""1 sigma of the Earth's light on a cell that a filter without a model of it counts on."""

_SKEWED = 1.0 / math.sqrt(3.0)
_ALONG = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_PYRAMID = tuple((x * _SKEWED, y * _SKEWED, _SKEWED) for x, y in ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)))
_SPUN_UP = 0.8  # of the wheels' momentum that the tip-off may take
_DEGREE = math.pi / 180.0


@dataclass(frozen=True)
class Design:
    """A spacecraft of which everything is known.

    Attributes:
        asked: value of each item, as `items` read it.
        origin: where the value of each item is from: `given`, `answered`, or the name of a template.
        wheel_axes: (N, 3) unit spin axes in b, none without wheels.
        loop: gains of the control with wheels; None with rods alone, and until `with_gains`.
    """

    name: str
    asked: Mapping[str, Any]
    origin: Mapping[str, str]
    orbit: Orbit
    inertia: np.ndarray
    panels: tuple[Panel, ...]
    plates: Plates
    normals: tuple[Vector, ...]
    array_normal: Vector
    wheel_axes: np.ndarray
    wheels: Capacity | None
    loop: Loop | None
    estimator: str
    cell_sigma: float
    substeps: int


def design(name: str, asked: Mapping[str, Any], origin: Mapping[str, str]) -> Design:
    """The design of what was asked.

    Args:
        name: of the mission.
        asked: value of each item.
        origin: where each is from.

    Raises:
        DesignError: it cannot be flown; says by which option.
    """
    panels = panels_of(asked["panels"])
    inertia, box_centre = _inertia(asked, panels)
    orbit = orbit_of(asked["orbit"], asked["epoch"])
    axes = np.array({"3": _ALONG, "4": _PYRAMID}.get(asked["wheels"], ()), dtype=float).reshape(-1, 3)
    if not len(axes) and asked["rods"] is None:
        raise DesignError("--wheels, --rods: none of both given, expected wheels or rods: nothing turns the body")
    if not len(axes) and asked["magnetometer"] is None:
        raise DesignError("--magnetometer: none given, expected one: rods alone are steered by the measured field")
    estimator = _estimator(asked, bool(len(axes)))
    wheels = capacity(axes, asked["wheel_torque"], asked["wheel_momentum"]) if len(axes) else None
    normals = (*asked["cells"], *(panel.normal for panel in panels for _ in range(panel.cells)))
    array_normal = _array_normal(asked, panels, inertia, spun=wheels is None)
    if wheels is not None:
        _check_tip_off(asked, inertia, wheels)
    return Design(
        name=name,
        asked=asked,
        origin=origin,
        orbit=orbit,
        inertia=inertia,
        panels=panels,
        plates=plates_of(asked["size"], box_centre, panels),
        normals=normals,
        array_normal=array_normal,
        wheel_axes=axes,
        wheels=wheels,
        loop=None,
        estimator=estimator,
        cell_sigma=_cell_sigma(asked),
        substeps=substeps_of(asked["tip_off"], asked["period"]),
    )


def _inertia(asked: Mapping[str, Any], panels: tuple[Panel, ...]) -> tuple[np.ndarray, np.ndarray]:
    computed, box_centre = inertia_of(asked["size"], asked["mass"], panels)
    given = asked["inertia"]
    if given is None:
        return computed, box_centre
    inertia = np.diag(given) if len(given) == 3 else np.reshape(given, (3, 3))
    if not np.allclose(inertia, inertia.T, rtol=1e-9, atol=0.0):
        raise DesignError("--inertia: not symmetric, expected a symmetric matrix")
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        shown = ", ".join(f"{moment:.4g}" for moment in moments)
        raise DesignError(
            f"--inertia: principal moments {shown} kg m^2 given, expected three above 0 of which none is above the "
            "sum of the others: no rigid body has these"
        )
    return inertia, box_centre


def _estimator(asked: Mapping[str, Any], has_wheels: bool) -> str:
    name = asked["estimator"]
    if name != "auto":
        return str(name)
    return "sun_filter" if has_wheels else "wls"


def _array_normal(asked: Mapping[str, Any], panels: tuple[Panel, ...], inertia: np.ndarray, spun: bool) -> Vector:
    if asked["array_normal"] != "auto":
        try:
            return direction(asked["array_normal"])
        except DesignError as error:
            raise DesignError(f"{BY_NAME['array_normal'].flag}: {error}, or auto") from error
    if spun:  # a body keeps no spin about another axis
        largest = np.linalg.eigh(inertia)[1][:, 2]
        return _nearest_face(largest * np.sign(largest[np.argmax(np.abs(largest))]))
    if panels:
        total = np.sum([panel.length * np.array(panel.normal) for panel in panels], axis=0)
        if np.linalg.norm(total) > 1e-9:
            return _nearest_face(total / np.linalg.norm(total))
        raise DesignError("--array-normal: auto given, expected a direction: the panels look opposite ways")
    x, y, z = asked["size"]
    areas = {"+x": y * z, "+y": x * z, "+z": x * y}
    return FACES[max(areas, key=lambda face: areas[face])]


def _nearest_face(vector: np.ndarray) -> Vector:
    """The face along a unit vector, free of rounding; the vector itself where it is along none."""
    for face in FACES.values():
        if np.dot(face, vector) > 1.0 - 1e-9:
            return face
    x, y, z = (float(part) for part in vector)
    return x, y, z


def _cell_sigma(asked: Mapping[str, Any]) -> float:
    """Error of a cell's output in the eyes of a filter, 1 sigma: all of it, at the mean square cosine of a half sky.

    Over the half sphere that a cell sees, cos^2 and sin^2 of the incidence have the means 1/3 and 2/3.
    """
    bits = int(asked["cell_bits"])
    step = 2.0 / 2**bits if bits else 0.0
    squares = (
        asked["cell_noise"] ** 2,
        step**2 / 12.0,
        asked["cell_scale"] ** 2 / 3.0,
        (asked["cell_tilt"] * _DEGREE) ** 2 * 2.0 / 3.0,
        EARTHLIGHT**2,
    )
    return float(f"{math.sqrt(sum(squares)):.3g}")


def with_gains(known: Design, model: LoopModel) -> Design:
    """The design with the gains of its control.

    Args:
        known: of a spacecraft with wheels.
        model: the loop of its mission, but for the gains.

    Raises:
        DesignError: no gains keep the margin.
    """
    assert known.wheels is not None
    return replace(known, loop=designed(model, known.wheels, RATE_CUTOFF))


def _check_tip_off(asked: Mapping[str, Any], inertia: np.ndarray, wheels: Capacity) -> None:
    fastest = float(np.linalg.eigvalsh(inertia)[2]) * asked["tip_off"] * _DEGREE
    if fastest > _SPUN_UP * wheels.momentum:
        most = asked["tip_off"] * _SPUN_UP * wheels.momentum / fastest
        raise DesignError(
            f"--tip-off: {asked['tip_off']:g} deg/s given, {fastest:.3g} N m s about the axis of the largest moment, "
            f"expected at most {most:.3g} deg/s: the wheels take {wheels.momentum:.3g} N m s in every direction, a "
            f"fifth of it is kept for turning (or a larger --wheel-momentum)"
        )


def substeps_of(rate_deg_s: float, period_s: float) -> int:
    """Integration steps of a control cycle in which a body turns by no more than the integrator bears at a time."""
    return max(1, math.ceil(rate_deg_s * _DEGREE * period_s / LARGEST_ANGLE))
