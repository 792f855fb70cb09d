# SPDX-License-Identifier: Apache-2.0
"""What stands around the cells, from boxes or a mesh, and which directions it blocks from places on the body.

A file of boxes:

    boxes:                                  # in b [m]; the first is the body that cells are mounted on
      - {centre: [0.0, 0.0, 0.0], size: [0.1, 0.1, 0.3]}
      - {centre: [0.0, 0.2, 0.15], size: [0.1, 0.3, 0.004]}
    mesh: antenna.stl                       # beside them or instead, relative to this file
    scale: 0.001                            # of the mesh: 0.001 for millimetres
    cells: [[0.05, 0.0, 0.1], ...]          # places of the mission's own cells [m]

An STL, OBJ or PLY file alone is a mesh in b [m], and all of it is the body. A cell without a place is in the middle of
the face that its normal is nearest to.
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from css_common.direction_grid import SIZE, grid_directions
from css_common.file_text import decoded
from css_common.kernel import outer_kernel
from css_design.errors import DesignError

_MESHES = (".stl", ".obj", ".ply")
_LARGEST = 100.0  # [m]
_CLEAR = 1e-4  # [m] that a cell stands out of its face
_FINER = 2  # rays across a cell of the grid
_KEYS = {"boxes", "mesh", "scale", "cells"}


class Structure(NamedTuple):
    """Triangles in b.

    Attributes:
        triangles: (F, 3, 3) corners [m].
        body: how many of them, from the first on, are the body.
        cells: (N, 3) places of the mission's own cells [m]; none where they are not given.
    """

    triangles: np.ndarray
    body: int
    cells: np.ndarray

    @property
    def extent(self) -> np.ndarray:
        """(3,) size of all of it [m]."""
        return np.ptp(self.triangles.reshape(-1, 3), axis=0)


def read_structure(path: Path) -> Structure:
    """The structure of a file.

    Raises:
        DesignError: it cannot be read, or holds no structure.
    """
    if path.suffix.lower() in _MESHES:
        triangles = _mesh(path, 1.0)
        return _checked(Structure(triangles, len(triangles), np.zeros((0, 3))), path)
    try:
        given = yaml.safe_load(decoded(path.read_bytes()))
    except OSError as error:
        raise DesignError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise DesignError(f"{path}: cannot be read: {error}") from error
    except yaml.YAMLError as error:
        raise DesignError(f"{path}: no YAML, expected boxes: [{{centre: [x, y, z], size: [x, y, z]}}, ...]") from error
    if not isinstance(given, dict) or not given or not _KEYS.issuperset(given):
        raise DesignError(f"{path}: expected some of the keys {', '.join(sorted(_KEYS))}")
    boxes = [_box(path, i, box) for i, box in enumerate(_list(path, given, "boxes"))]
    meshes = []
    if "mesh" in given:
        scale = given.get("scale", 1.0)
        if not isinstance(scale, (int, float)) or not 0.0 < scale < 1e6:
            raise DesignError(f"{path}: scale: {scale!r} given, expected a number above 0, such as 0.001")
        meshes = [_mesh(path.parent / str(given["mesh"]), float(scale))]
    if not (boxes or meshes):
        raise DesignError(f"{path}: holds neither boxes nor mesh")
    parts = [*boxes, *meshes]
    cells = [_vector(path, f"cells[{i}]", cell) for i, cell in enumerate(_list(path, given, "cells"))]
    return _checked(Structure(np.concatenate(parts), len(parts[0]), np.array(cells).reshape(-1, 3)), path)


def _checked(found: Structure, path: Path) -> Structure:
    largest = float(np.max(found.extent))
    if not 0.0 < largest <= _LARGEST:
        raise DesignError(
            f"{path}: {largest:g} m across, expected metres, up to {_LARGEST:g}; of millimetres scale: 0.001"
        )
    return found


def _list(path: Path, given: dict[str, Any], key: str) -> list[Any]:
    value = given.get(key, [])
    if not isinstance(value, list):
        raise DesignError(f"{path}: {key}: expected a list")
    return value


def _vector(path: Path, where: str, value: Any) -> np.ndarray:
    is_vector = isinstance(value, list) and len(value) == 3
    if not is_vector or not all(isinstance(x, (int, float)) and math.isfinite(x) for x in value):
        raise DesignError(f"{path}: {where}: {value!r} given, expected three numbers [m]")
    return np.array(value, dtype=np.float64)


def _box(path: Path, i: int, box: Any) -> np.ndarray:
    if not isinstance(box, dict) or set(box) != {"centre", "size"}:
        raise DesignError(f"{path}: boxes[{i}]: expected {{centre: [x, y, z], size: [x, y, z]}}")
    centre, size = (_vector(path, f"boxes[{i}].{key}", box[key]) for key in ("centre", "size"))
    if not np.all(size > 0.0):
        raise DesignError(f"{path}: boxes[{i}].size: expected three numbers above 0 [m]")
    from trimesh.creation import box as made  # slow to load

    return np.array(made(extents=size).triangles) + centre


def _mesh(path: Path, scale: float) -> np.ndarray:
    import trimesh

    try:
        mesh: Any = trimesh.load(path, force="mesh")
        triangles = np.array(mesh.triangles, dtype=np.float64)
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise DesignError(f"{path}: no mesh that can be read, expected STL, OBJ or PLY") from error
    if not triangles.size or not np.all(np.isfinite(triangles)):
        raise DesignError(f"{path}: holds no triangles, expected a mesh")
    return scale * triangles


class Blocking:
    """Which directions a structure blocks from places on the body; each place is looked at once."""

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        corners = structure.triangles[: structure.body].reshape(-1, 3)
        self._centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        self._known: dict[bytes, np.ndarray] = {}

    def table(self, normals_b: np.ndarray, places: np.ndarray | None = None) -> np.ndarray:
        """Masks (SIZE,) of the cells, up to 32, that are blocked in each direction of the grid, uint32.

        Args:
            normals_b: (N, 3).
            places: (N, 3) [m]; None: in the middle of the face that each normal is nearest to.

        Raises:
            DesignError: a face is not there.
        """
        masks = np.zeros(SIZE, np.uint32)
        for i, normal in enumerate(normals_b):
            place = self._on_face(normal) if places is None else places[i] + _CLEAR * normal
            masks |= self.blocked_from(place).astype(np.uint32) << np.uint32(i)
        return masks

    def blocked_from(self, place: np.ndarray) -> np.ndarray:
        """(SIZE,) whether most of each cell of the grid is hidden from a place [m]."""
        key = np.round(place, 9).tobytes()
        if key not in self._known:
            rays = grid_directions(_FINER).reshape(-1, 3)
            hit = np.zeros(len(rays), np.bool_)
            _cast(self._structure.triangles, place, np.ascontiguousarray(rays), hit)
            self._known[key] = hit.reshape(SIZE, -1).mean(axis=1) > 0.5
        return self._known[key]

    def _on_face(self, normal: np.ndarray) -> np.ndarray:
        axis = np.zeros(3)
        k = int(np.argmax(np.abs(normal)))
        axis[k] = math.copysign(1.0, normal[k])
        body = self._structure.triangles[: self._structure.body]
        reach = _farthest(np.ascontiguousarray(body), self._centre, axis)
        if reach <= 0.0:
            raise DesignError(f"the structure has nothing along {axis.tolist()} from its middle for a cell to stand on")
        return self._centre + (reach + _CLEAR) * axis


@outer_kernel
def _distance(triangle, origin, d) -> float:
    """Distance along a unit vector to a triangle, -1 when it is missed (Moeller & Trumbore 1997)."""
    e1x, e1y, e1z = (
        triangle[1, 0] - triangle[0, 0],
        triangle[1, 1] - triangle[0, 1],
        triangle[1, 2] - triangle[0, 2],
    )
    e2x, e2y, e2z = (
        triangle[2, 0] - triangle[0, 0],
        triangle[2, 1] - triangle[0, 1],
        triangle[2, 2] - triangle[0, 2],
    )
    px, py, pz = d[1] * e2z - d[2] * e2y, d[2] * e2x - d[0] * e2z, d[0] * e2y - d[1] * e2x
    determinant = e1x * px + e1y * py + e1z * pz
    if abs(determinant) < 1e-15:
        return -1.0
    sx, sy, sz = origin[0] - triangle[0, 0], origin[1] - triangle[0, 1], origin[2] - triangle[0, 2]
    u = (sx * px + sy * py + sz * pz) / determinant
    if u < 0.0 or u > 1.0:
        return -1.0
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (d[0] * qx + d[1] * qy + d[2] * qz) / determinant
    if v < 0.0 or u + v > 1.0:
        return -1.0
    return (e2x * qx + e2y * qy + e2z * qz) / determinant


@outer_kernel
def _cast(triangles, origin, rays, hit_out) -> None:
    for r in range(rays.shape[0]):
        for f in range(triangles.shape[0]):
            if _distance(triangles[f], origin, rays[r]) > 0.0:
                hit_out[r] = True
                break


@outer_kernel
def _farthest(triangles, origin, ray) -> float:
    farthest = -1.0
    for f in range(triangles.shape[0]):
        farthest = max(farthest, _distance(triangles[f], origin, ray))
    return farthest
