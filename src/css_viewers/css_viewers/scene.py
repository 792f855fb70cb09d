# SPDX-License-Identifier: Apache-2.0
"""A spacecraft, what it senses and what it believes, as shapes.

The spacecraft stands at the origin of a frame with inertial axes: a viewer that draws millions of metres has no
digits left for a body of one. Directions to far things are arrows; the Earth is a sphere near by, at the angle and of
the angular size that it has from there.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from css_analysis.flight_series import MODES
from css_common.actuator_sections import WHEEL_MAX_SPEED, of_each_wheel, wheel_axes
from css_common.attitude import mrp_to_dcm
from css_common.codec import Sample
from css_common.earth import EARTH_RADIUS
from css_common.schema import Values
from css_common.vectors import Vec3, multiply, unit, vector_of
from css_msgs.msg import SunEstimate
from css_sensors.cells import FIELD_OF_VIEW, FIELDS_OF_VIEW, NORMALS
from css_viewers.shapes import ARROW, CUBE, CYLINDER, SPHERE, TEXT, TRIANGLES, Colour, Shape, along, cone

# The colours of the figures and pages (Okabe and Ito), which the colour-blind tell apart too.
_BODY: Colour = (0.75, 0.75, 0.78, 1.0)
_ARRAY: Colour = (0.0, 0.27, 0.55, 1.0)
_SUN: Colour = (0.94, 0.89, 0.26, 1.0)
_ESTIMATE: Colour = (0.84, 0.37, 0.0, 1.0)
_HELD: Colour = (0.84, 0.37, 0.0, 0.35)
_FAILED: Colour = (0.8, 0.1, 0.1, 1.0)
_DARK: Colour = (0.25, 0.25, 0.25, 1.0)
_WHEEL: Colour = (0.0, 0.62, 0.45, 1.0)
_EARTH: Colour = (0.2, 0.45, 0.8, 1.0)
_WHITE: Colour = (1.0, 1.0, 1.0, 1.0)

_LONGEST = 1.0  # side of the body [m]: a drawing of it, a mission has no sizes
_VIEW = 0.6  # mantle of a cell's view [m]
_ARROW = 2.2  # [m]
_EARTH_AWAY = 6.0  # [m]
_SIGMAS = 3.0


class Scene:
    """The shapes of one spacecraft.

    Attributes:
        frames: names of the frames in which its shapes stand, body first.
    """

    def __init__(self, values: Values, body_frame: str, local_frame: str) -> None:
        """Takes what does not change.

        Args:
            values: of a component with the sections spacecraft, cells and wheels.
            body_frame: frame_id of the body.
            local_frame: frame_id of inertial axes at the spacecraft.
        """
        self.frames = body_frame, local_frame
        self._half_sides = 0.5 * sides_of(values.spacecraft.inertia)
        self._array_normal: Vec3 = vector_of(values.spacecraft.array_normal)
        self._normals = np.asarray(values[NORMALS], dtype=np.float64).reshape(-1, 3)
        own = values[FIELDS_OF_VIEW]
        views = own if len(own) else np.full(len(self._normals), values[FIELD_OF_VIEW])
        self._half_views = np.radians(0.5 * np.asarray(views))
        self._wheel_axes = wheel_axes(values)
        self._wheel_speeds = of_each_wheel(values, WHEEL_MAX_SPEED) * (2.0 * math.pi / 60.0)
        self._still = tuple(self._body())
        self._places = [self._on_surface(normal) for normal in self._normals]
        self._views = [
            cone(tip, axis, float(half), _VIEW)
            for (tip, axis), half in zip(self._places, self._half_views, strict=True)
        ]

    def shapes(self, truth: Sample, heard: dict[str, Sample | None]) -> list[Shape]:
        """All that is drawn at one stamp.

        Args:
            truth: SpacecraftState.
            heard: `cells` (CssVoltages), `sun` (SunEstimate), `wheels` (WheelState), `status` (ControlStatus), each
                None where there is none: what it would show is then left out, or drawn as unknown.
        """
        sun = heard.get("sun")
        shapes = [*self._still, *self._cells(heard.get("cells"), sun), *self._wheels(heard.get("wheels"))]
        shapes += self._around(truth)
        if sun is not None:
            shapes += self._estimate(sun)
        shapes.append(self._text(truth, sun, heard.get("status")))
        return shapes

    def _body(self) -> Iterator[Shape]:
        body, sides = self.frames[0], 2.0 * self._half_sides
        yield Shape("body", 0, CUBE, body, _BODY, size=tuple(sides.tolist()))
        if not any(self._array_normal):
            return
        # two plates beside the body, along the longer of the axes that lie in their plane
        normal = np.asarray(self._array_normal)
        flat = np.argsort(np.abs(normal))[:2]
        along_axis = np.zeros(3)
        along_axis[flat[np.argmax(self._half_sides[flat])]] = 1.0
        along_axis -= normal * (along_axis @ normal)
        along_axis /= np.linalg.norm(along_axis)
        reach = float(np.abs(along_axis) @ self._half_sides)
        for number, side in enumerate((1.0, -1.0)):
            middle = tuple((side * (reach + 0.55) * along_axis).tolist())
            yield Shape("arrays", number, CUBE, body, _ARRAY, (0.9, 0.9, 0.02), middle, along(vector_of(normal)))

    def _cells(self, cells: Sample | None, sun: Sample | None) -> Iterator[Shape]:
        for i, (tip, axis) in enumerate(self._places):
            output = float("nan") if cells is None else float(cells.voltages[i])
            failed = sun is not None and bool(int(sun.isolated) >> i & 1)
            lit = 0.0 if math.isnan(output) else min(max(output, 0.0), 1.0)
            colour = _FAILED if failed else _between(_DARK, _SUN, lit)
            yield Shape("cells", i, CYLINDER, self.frames[0], colour, (0.12, 0.12, 0.04), tip, along(axis))
            faint = (*colour[:3], 0.08 + 0.17 * lit)
            yield Shape("views", i, TRIANGLES, self.frames[0], faint, points=self._views[i])

    def _on_surface(self, normal: np.ndarray) -> tuple[Vec3, Vec3]:
        """Where a line from the middle of the body along a normal leaves it, and the normal."""
        with np.errstate(divide="ignore"):
            return vector_of(normal * np.min(self._half_sides / np.abs(normal))), vector_of(normal)

    def _wheels(self, wheels: Sample | None) -> Iterator[Shape]:
        for i, axis in enumerate(self._wheel_axes):
            unit_axis = vector_of(axis)
            share = 0.0 if wheels is None else min(abs(float(wheels.speed[i])) / self._wheel_speeds[i], 1.0)
            middle = vector_of(0.25 * axis)
            colour = _between(_DARK, _WHEEL, share)
            yield Shape("wheels", i, CYLINDER, self.frames[0], colour, (0.2, 0.2, 0.05), middle, along(unit_axis))

    def _around(self, truth: Sample) -> Iterator[Shape]:
        local = self.frames[1]
        lit = float(truth.illumination)
        yield _arrow("sun", local, _between((0.35, 0.35, 0.35, 1.0), _SUN, lit), vector_of(truth.sun_n))
        distance = float(np.linalg.norm(truth.r_n))
        if distance > EARTH_RADIUS:
            down = vector_of(-np.asarray(truth.r_n) / distance)
            radius = _EARTH_AWAY * EARTH_RADIUS / distance
            middle = vector_of(_EARTH_AWAY * np.asarray(down))
            yield Shape("earth", 0, SPHERE, local, _EARTH, (2.0 * radius,) * 3, middle)

    def _estimate(self, sun: Sample) -> Iterator[Shape]:
        if sun.validity == SunEstimate.VALIDITY_NONE or not np.any(sun.sun_b):
            return
        direction = unit(vector_of(sun.sun_b))
        colour = _ESTIMATE if sun.validity == SunEstimate.VALIDITY_VALID else _HELD
        yield _arrow("sun_estimate", self.frames[0], colour, direction)
        if sun.covariance[0] >= 0.0:
            variance = float(np.max(np.linalg.eigvalsh(np.asarray(sun.covariance).reshape(3, 3))))
            half = min(_SIGMAS * math.sqrt(max(variance, 0.0)), math.pi)
            rim = cone((0.0, 0.0, 0.0), direction, half, _ARROW)
            yield Shape("sun_uncertainty", 0, TRIANGLES, self.frames[0], (*colour[:3], 0.2), points=rim)

    def _text(self, truth: Sample, sun: Sample | None, status: Sample | None) -> Shape:
        words = []
        if status is not None:
            words.append(MODES.get(int(status.mode), f"mode {int(status.mode)}"))
        if sun is None or sun.validity == SunEstimate.VALIDITY_NONE:
            words.append("no Sun estimate")
        else:
            sun_b = multiply(mrp_to_dcm(vector_of(truth.sigma_bn)), vector_of(truth.sun_n))
            cosine = float(np.clip(np.dot(sun_b, unit(vector_of(sun.sun_b))), -1.0, 1.0))
            words.append(f"heading error {math.degrees(math.acos(cosine)):.2f} deg")
        words.append(f"Sun {float(truth.illumination):.0%}")
        return Shape("text", 0, TEXT, self.frames[1], _WHITE, (0.0, 0.0, 0.2), (0.0, 0.0, 1.8), text=", ".join(words))


def sides_of(inertia: Any) -> np.ndarray:
    """Sides (3,) [m] of a box whose longest is 1 m and whose moments of inertia have the ratios of a body's.

    Args:
        inertia: (9,) [kg m^2], row-major; its diagonal counts. Empty: not known, and the box is a cube.
    """
    if not len(inertia):
        return np.full(3, _LONGEST)
    moments = np.diag(np.asarray(inertia, dtype=np.float64).reshape(3, 3))
    squares = np.maximum(moments.sum() - 2.0 * moments, 1e-4 * moments.sum())
    sides = np.sqrt(squares)
    return _LONGEST * sides / sides.max()


def _arrow(group: str, frame: str, colour: Colour, direction: Vec3) -> Shape:
    points = np.array([(0.0, 0.0, 0.0), direction]) * _ARROW
    return Shape(group, 0, ARROW, frame, colour, (0.04, 0.1, 0.2), points=points)


def _between(low: Colour, high: Colour, share: float) -> Colour:
    red, green, blue, opacity = ((1.0 - share) * a + share * b for a, b in zip(low, high, strict=True))
    return (red, green, blue, opacity)
