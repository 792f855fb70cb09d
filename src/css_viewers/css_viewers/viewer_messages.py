# SPDX-License-Identifier: Apache-2.0
"""Shapes as `visualization_msgs/MarkerArray`, an attitude as transforms: the plain classes of `rosbags`."""

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from css_common.attitude import Quat
from css_common.tree_codec import plain_types
from css_common.vectors import Vec3
from css_viewers.shapes import ARROW, CUBE, CYLINDER, SPHERE, TEXT, TRIANGLES, UPRIGHT, Colour, Shape

_GEOMETRY, _MARKERS = "geometry_msgs/msg/", "visualization_msgs/msg/"
_NS = 1_000_000_000


def _message(type_name: str, **values: Any) -> Any:
    return plain_types().types[type_name](**values)


def header(stamp_ns: int, frame_id: str) -> Any:
    """A std_msgs/Header."""
    seconds, nanoseconds = divmod(stamp_ns, _NS)
    stamp = _message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return _message("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def marker_array(stamp_ns: int, shapes: Iterable[Shape], gone: Iterable[tuple[str, int]] = ()) -> Any:
    """Markers of shapes.

    Args:
        stamp_ns: of all of them.
        shapes: what is to be drawn.
        gone: group and number of shapes that were drawn before and are no more.
    """
    markers = [_marker(stamp_ns, shape) for shape in shapes]
    kind: Any = plain_types().types[f"{_MARKERS}Marker"]
    nothing = Shape("", 0, CUBE, "", (0.0, 0.0, 0.0, 0.0))
    markers += [_marker(stamp_ns, nothing._replace(group=group, number=number), kind.DELETE) for group, number in gone]
    return _message(f"{_MARKERS}MarkerArray", markers=markers)


def transforms(stamp_ns: int, links: Iterable[tuple[str, str, Vec3, Quat]]) -> Any:
    """A tf2_msgs/TFMessage.

    Args:
        stamp_ns: of all of them.
        links: frame, frame in it, place of that [m], and the quaternion (scalar last) that turns its vectors out.
    """
    made = [
        _message(
            f"{_GEOMETRY}TransformStamped",
            header=header(stamp_ns, parent),
            child_frame_id=child,
            transform=_message(f"{_GEOMETRY}Transform", translation=_vector(place), rotation=_quaternion(turn)),
        )
        for parent, child, place, turn in links
    ]
    return _message("tf2_msgs/msg/TFMessage", transforms=made)


def _marker(stamp_ns: int, shape: Shape, action: int = 0) -> Any:
    kind: Any = plain_types().types[f"{_MARKERS}Marker"]
    kinds = {
        CUBE: kind.CUBE,
        SPHERE: kind.SPHERE,
        CYLINDER: kind.CYLINDER,
        ARROW: kind.ARROW,
        TRIANGLES: kind.TRIANGLE_LIST,
        TEXT: kind.TEXT_VIEW_FACING,
    }
    image = _message("sensor_msgs/msg/CompressedImage", header=header(0, ""), format="", data=np.zeros(0, np.uint8))
    mesh = _message(f"{_MARKERS}MeshFile", filename="", data=np.zeros(0, np.uint8))
    return kind(
        header=header(stamp_ns, shape.frame),
        ns=shape.group,
        id=shape.number,
        type=kinds[shape.kind],
        action=action,
        pose=_message(f"{_GEOMETRY}Pose", position=_point(shape.position), orientation=_quaternion(shape.orientation)),
        scale=_vector(shape.size),
        color=_colour(shape.colour),
        lifetime=_message("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=_points(shape.points.tobytes()),
        colors=[],
        texture_resource="",
        texture=image,
        uv_coordinates=[],
        text=shape.text,
        mesh_resource="",
        mesh_file=mesh,
        mesh_use_embedded_materials=False,
    )


@lru_cache(maxsize=256)
def _points(of_doubles: bytes) -> list[Any]:
    """Points of doubles in a row; most stay from one stamp to the next."""
    return [_point(point) for point in np.frombuffer(of_doubles).reshape(-1, 3).tolist()]


def _point(values: Iterable[float]) -> Any:
    x, y, z = values
    return _message(f"{_GEOMETRY}Point", x=x, y=y, z=z)


def _vector(values: Vec3) -> Any:
    x, y, z = values
    return _message(f"{_GEOMETRY}Vector3", x=x, y=y, z=z)


def _quaternion(values: Quat = UPRIGHT) -> Any:
    x, y, z, w = values
    return _message(f"{_GEOMETRY}Quaternion", x=x, y=y, z=z, w=w)


def _colour(colour: Colour) -> Any:
    red, green, blue, opacity = colour
    return _message("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=opacity)
