# SPDX-License-Identifier: Apache-2.0
"""The scene of a recording as a file for the Rerun viewer."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from css_common.tree_codec import plain_types
from css_viewers.errors import ViewerError
from css_viewers.viewed_bag import ViewedBag

_APPLICATION = "sunpoint"
_TIMELINE = "flight"
_INSTALL = "./sunpoint shell -c 'uv pip install -r requirements-rerun.lock'"


def write_rerun(viewed: ViewedBag, file: Path) -> None:
    """Writes the file.

    Raises:
        ViewerError: Rerun is not installed, or the file cannot be written.
        BagError: the recording cannot be read to its end.
    """
    try:
        import rerun  # not everybody has it
    except ImportError as error:
        raise ViewerError(f"--rerun needs rerun-sdk: {_INSTALL}") from error
    if file.is_dir() or not file.absolute().parent.is_dir():
        raise ViewerError(f"--rerun {file}: expected a file to write in a folder that is there")
    unfinished = file.with_name(f"{file.name}.part")
    stream = rerun.RecordingStream(_APPLICATION, recording_id=viewed.mission.name)
    try:
        stream.save(unfinished)
        _draw(rerun, stream, viewed)
        stream.flush()
        stream.disconnect()
        unfinished.replace(file)
    except (OSError, RuntimeError) as error:
        raise ViewerError(f"--rerun {file}: cannot be written: {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)


def _draw(rerun: Any, stream: Any, viewed: ViewedBag) -> None:
    drawing = _Drawing(rerun, stream)
    for drawn in viewed.messages():
        stream.set_time(_TIMELINE, timestamp=np.datetime64(drawn.stamp_ns, "ns"))
        message: Any = plain_types().deserialize_cdr(drawn.data, drawn.type_name)
        if drawn.type_name.endswith("/TFMessage"):
            drawing.turn(message.transforms)
        elif drawn.type_name.endswith("/MarkerArray"):
            drawing.draw(message.markers)


class _Drawing:
    """Messages for viewers as what Rerun logs; frames become a tree of entities."""

    def __init__(self, rerun: Any, stream: Any) -> None:
        self._rerun = rerun
        self._stream = stream
        self._paths: dict[str, str] = {}
        self._drawn: dict[tuple[str, int], str] = {}

    def turn(self, transforms: Iterable[Any]) -> None:
        """Places frames in each other."""
        for link in transforms:
            parent = self._paths.setdefault(link.header.frame_id, link.header.frame_id)
            path = self._paths[link.child_frame_id] = f"{parent}/{link.child_frame_id}"
            place, turn = link.transform.translation, link.transform.rotation
            # the spacecraft stays in the middle: see `css_viewers.scene`
            where = (0.0, 0.0, 0.0) if parent == link.header.frame_id else (place.x, place.y, place.z)
            rotation = self._rerun.Quaternion(xyzw=(turn.x, turn.y, turn.z, turn.w))
            self._stream.log(path, self._rerun.Transform3D(translation=where, quaternion=rotation))

    def draw(self, markers: Iterable[Any]) -> None:
        """Logs markers, each an entity of its own."""
        for marker in markers:
            if marker.action:
                gone = self._drawn.pop((marker.ns, marker.id), None)
                if gone is not None:
                    self._stream.log(gone, self._rerun.Clear(recursive=True))
                continue
            frame = self._paths.get(marker.header.frame_id, marker.header.frame_id)
            path = self._drawn[marker.ns, marker.id] = f"{frame}/{marker.ns}/{marker.id}"
            self._stream.log(path, self._archetype(marker))

    def _archetype(self, marker: Any) -> Any:
        rerun = self._rerun
        colour = [round(255 * part) for part in (marker.color.r, marker.color.g, marker.color.b, marker.color.a)]
        place, turn = marker.pose.position, marker.pose.orientation
        size = (marker.scale.x, marker.scale.y, marker.scale.z)
        posed = {
            "centers": [(place.x, place.y, place.z)],
            "quaternions": [rerun.Quaternion(xyzw=(turn.x, turn.y, turn.z, turn.w))],
            "colors": [colour],
        }
        points = np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 3)
        if marker.type == marker.CUBE:
            return rerun.Boxes3D(sizes=[size], fill_mode="solid", **posed)
        if marker.type == marker.SPHERE:
            return rerun.Ellipsoids3D(half_sizes=[np.array(size) / 2.0], fill_mode="solid", **posed)
        if marker.type == marker.CYLINDER:
            return rerun.Cylinders3D(lengths=[size[2]], radii=[size[0] / 2.0], fill_mode="solid", **posed)
        if marker.type == marker.ARROW:
            ends = {"origins": [points[0]], "vectors": [points[1] - points[0]]}
            return rerun.Arrows3D(**ends, radii=[size[0] / 2.0], colors=[colour])
        if marker.type == marker.TRIANGLE_LIST:
            corners = np.arange(len(points)).reshape(-1, 3)
            return rerun.Mesh3D(vertex_positions=points, triangle_indices=corners, albedo_factor=colour)
        return rerun.TextDocument(marker.text)
