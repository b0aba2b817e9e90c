"""Where the cloth ends, as photos show it, beside where a scanned garment ends.

Counts of openings do not tell: a garment drawn in panels has an opening a panel, and rims that lie under other cloth,
or on it, are openings that nothing can show. Lengths do, both ways: what was found of the rims that are there to be
found, and what of the scan's rims is true.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.scan.blame import ENOUGH, photos_that_show
from vto_pipeline.geometry.topology import boundary_walks, concatenate, face_normals, half_edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.mesh import TriangleMesh

NEAR = 0.01
"""So near, one rim follows another [m]."""
APART = 0.002
"""Rims are looked at in places so far apart at most [m]."""
WITHIN = 0.001
"""Photos are asked for a place so far from the edge, on the cloth [m]."""
BEYOND, ABOVE, LAYER = 0.004, 0.002, 0.03
"""The cloth ends where, so far beyond its edge and from so far above, no cloth is met for so far down [m]."""


class _Rims(NamedTuple):
    """All boundary loops of a mesh as N places, each standing for a part of their length.

    Args:
        points: On the edge [m], shape (N, 3).
        normals: Of the cloth there, shape (N, 3).
        inward: From the edge along the cloth, unit, shape (N, 3).
        length: [m], shape (N,).
    """

    points: FloatArray
    normals: FloatArray
    inward: FloatArray
    length: FloatArray


def shown_rims(garment: TriangleMesh, truth: TriangleMesh, form: TriangleMesh, cameras: CameraSet) -> dict[str, Value]:
    """Return the length of the true rims that photos show [mm], how much of it a rim of the garment follows, and how
    much of the garment's rims follows no true one, shown or not [%].

    Args:
        garment: In the frame of the truth [m].
        truth: Open shell, oriented outward [m].
        form: What it was on [m].
        cameras: Of the photos, in that frame.
    """
    true, found = _rims(truth), _rims(garment)
    ends = _cloth_ends(true, truth, form)
    views = photos_that_show(true.points + WITHIN * true.inward, true.normals, concatenate([truth, form]), cameras)
    shown = ends & (views >= ENOUGH)
    return {
        "shown_rim_mm": 1e3 * float(true.length[shown].sum()),
        "rim_found_percent": _share(_follows(true.points, found.points), shown, true.length),
        "rim_false_percent": _share(
            ~_follows(found.points, true.points[ends]), np.ones(len(found.points), bool), found.length
        ),
    }


def _rims(mesh: TriangleMesh) -> _Rims:
    walks = boundary_walks(mesh)
    walk = np.concatenate(walks) if walks else np.zeros(0, np.int32)
    edges, face = half_edges(mesh)[walk], walk // 3
    start, along = mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]] - mesh.vertices[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    parts = np.maximum(np.ceil(length / APART).astype(int), 1)
    each = np.repeat(np.arange(len(walk)), parts)
    place = (np.arange(len(each)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[each]
    normals = face_normals(mesh)[face]
    inward = np.cross(normals, along)
    inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-12)
    return _Rims(start[each] + place[:, None] * along[each], normals[each], inward[each], (length / parts)[each])


def _cloth_ends(rims: _Rims, truth: TriangleMesh, form: TriangleMesh) -> NDArray[np.bool_]:
    """Return where no other cloth goes on beyond a rim, beside it or under it, shape (N,)."""
    import open3d as o3d

    core: Any = o3d.core  # its stubs know no NumPy array
    rays = o3d.t.geometry.RaycastingScene()
    for mesh in (truth, form):
        rays.add_triangles(core.Tensor(mesh.vertices.astype(np.float32)), core.Tensor(mesh.faces.astype(np.uint32)))
    start = rims.points - BEYOND * rims.inward + ABOVE * rims.normals
    hit = rays.cast_rays(core.Tensor(np.column_stack([start, -rims.normals]).astype(np.float32)))
    on_cloth = (hit["geometry_ids"].numpy() == 0) & (hit["t_hit"].numpy() < LAYER)
    return np.asarray(~on_cloth)


def _follows(points: FloatArray, others: FloatArray) -> NDArray[np.bool_]:
    """Return which points are near to some of others, shape (N,)."""
    if not len(points) or not len(others):
        return np.zeros(len(points), bool)
    return np.asarray(np.isfinite(cKDTree(others).query(points, distance_upper_bound=NEAR)[0]))


def _share(which: NDArray[np.bool_], among: NDArray[np.bool_], length: FloatArray) -> float | None:
    """Return which share of the length among is of those that are which [%]; None where there is none."""
    whole = float(length[among].sum())
    return 100.0 * float(length[among & which].sum()) / whole if whole else None
