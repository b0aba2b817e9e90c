"""Triangles of one size: decimate, then split, collapse, flip and relax; the openings keep place and length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.remeshing.decimate import decimate, faces_at
from vto_pipeline.geometry.remeshing.isotropic import isotropic
from vto_pipeline.geometry.remeshing.layers import Layers
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.rims import SMALL, even_rims, perimeter, rim_change, rim_corners
from vto_pipeline.geometry.remeshing.slivers import flip_slivers
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import (
    boundary_loops,
    edge_faces,
    edges,
    face_areas,
    face_components,
    submesh,
    surface_area,
    vertex_normals,
)
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

DECIMATE_TO = 5.0
"""A mesh much finer than wanted is first thinned to this many times the wanted number of faces."""

SAME_RIM = 0.02
"""Of the length of an opening: a smaller change is what chords of a curved rim make."""

ON_RIM = 1e-7
"""Nearer than this to the old rim, a vertex is on it [m]; the remesher projects rim vertices onto it."""


class RemeshConfig(Config):
    """How fine the triangles become."""

    edge_mm: float = Field(default=10.0, ge=1, le=100, description="Target edge length [mm]")
    iterations: int = Field(default=10, ge=1, le=50, description="Rounds of split, collapse, flip, relax")


def remesh(mesh: TriangleMesh, config: RemeshConfig, job: Job) -> TriangleMesh:
    """Return the surface in near-equilateral triangles of one edge length.

    The remesher (`isotropic`) pins open boundaries as they are, and as `even_rims` has left the small ones. Each other
    opening is first closed by a cone, its rim marked as a feature along which vertices may slide, and the cones are
    taken away again at the end. Sliding vertices cut corners, round for round, and a cone may pass through the surface.
    So where an opening has not kept its length, or layers cross that did not, corners are held; and where that will not
    do, all rims are pinned, at the cost of less even triangles beside them, and vertices are put back by `Layers`. Of
    the ways that make the fewest cross, the one that keeps the openings best counts.

    Raises:
        InputError: the mesh is not manifold.
        GarmentError: in no way is the result manifold, with the openings and pieces there were.
    """
    if not is_manifold(mesh):
        raise InputError("mesh is not manifold", hint="run geometry.repair first")
    edge = config.edge_mm * 1e-3
    job.progress(0.0, "decimating")
    coarse = decimate(mesh, int(DECIMATE_TO * faces_at(mesh, edge)), aggressiveness=3.0)
    if _broken(mesh, coarse) or rim_change(mesh, coarse) > SAME_RIM:
        coarse = mesh  # slower, but whole
    job.progress(0.3, "remeshing")
    best: TriangleMesh | None = None
    given, (crossing, change), problem = len(self_intersections(mesh)), (np.inf, np.inf), ""
    for way in (_slid, _slid_between_corners, *([_pinned] if len(_inner(coarse)) else [])):
        tried = flip_slivers(way(coarse, edge, config.iterations))
        broken = _broken(mesh, tried)
        problem = problem or broken
        if not broken:
            found = max(len(self_intersections(tried)) - given, 0), rim_change(mesh, tried)
            if found < (crossing, change):
                best, (crossing, change) = tried, found
        if crossing == 0 and change <= SAME_RIM:
            break
    if best is None:
        raise GarmentError(problem, hint="try an edge length well below the narrowest part of the garment")
    _measure(mesh, best, change, job)
    return best


def edge_lengths(mesh: TriangleMesh) -> FloatArray:
    """Return the length of each of `edges(mesh)` [m], shape (E,)."""
    pair = edges(mesh)
    return np.linalg.norm(mesh.vertices[pair[:, 0]] - mesh.vertices[pair[:, 1]], axis=1)


def _slid(mesh: TriangleMesh, edge: float, rounds: int) -> TriangleMesh:
    """Remesh with rims whose vertices slide along them."""
    return _with_cones(mesh, edge, rounds, hold_corners=False)


def _slid_between_corners(mesh: TriangleMesh, edge: float, rounds: int) -> TriangleMesh:
    """Remesh with rims whose vertices slide along them, but for their sharp turns."""
    return _with_cones(mesh, edge, rounds, hold_corners=True)


def _pinned(mesh: TriangleMesh, edge: float, rounds: int) -> TriangleMesh:
    """Remesh with rims as they are, once they are in even edges, and with each vertex put back in its own layer."""
    fine = even_rims(mesh, edge, np.inf)
    layers = Layers(fine, edge)
    for _ in range(rounds):
        fine = isotropic(fine, edge, 1, features=None, project=False)
        inner = _inner(fine)
        vertices = fine.vertices.copy()
        vertices[inner] = layers.nearest(vertices[inner], vertex_normals(fine)[inner])
        fine = TriangleMesh(vertices, fine.faces)
    return fine


def _inner(mesh: TriangleMesh) -> IntArray:
    """Return the vertices that are on no rim."""
    return np.setdiff1d(mesh.faces, np.concatenate([np.empty(0, np.int32), *boundary_loops(mesh)]))


def _with_cones(mesh: TriangleMesh, edge: float, rounds: int, hold_corners: bool) -> TriangleMesh:
    """Remesh with cones over the openings that are not small."""
    even = even_rims(mesh, edge, SMALL * edge)
    loops = [loop for loop in boundary_loops(even) if perimeter(even, loop) >= SMALL * edge]
    corners = [rim_corners(even, loop, edge) for loop in loops] if hold_corners else []
    closed = _close_with_cones(even, loops)
    fixed = np.concatenate([np.empty(0, np.int32), *corners])
    fine, rim_faces = _remesh_closed(closed, len(even.faces), edge, rounds, fixed)
    return submesh(fine, rim_faces)[0]


def _close_with_cones(mesh: TriangleMesh, loops: list[NDArray[np.int32]]) -> TriangleMesh:
    """Close boundary loops by cones pointing away from the surface; the new vertices and faces come last."""
    tips, cones, count = [], [], len(mesh.vertices)
    for loop in loops:
        points = mesh.vertices[loop]
        middle = points.mean(axis=0)
        # The area over half the perimeter: a circle's cone is as high as its radius.
        area = -0.5 * np.cross(points - middle, np.roll(points, -1, axis=0) - middle).sum(axis=0)
        tips.append(middle + area / (0.5 * perimeter(mesh, loop)))
        cones.append(np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), count)]))
        count += 1
    return TriangleMesh(np.vstack([mesh.vertices, *tips]), np.vstack([mesh.faces, *cones]).astype(np.int32))


def _remesh_closed(
    closed: TriangleMesh, real: int, edge: float, rounds: int, fixed: NDArray[np.int32]
) -> tuple[TriangleMesh, NDArray[np.bool_]]:
    """Remesh a surface whose faces from `real` on are cones; return it and which new faces are not of a cone."""
    is_cone = np.arange(len(closed.faces)) >= real
    beside = edge_faces(closed)
    rim = (
        edges(closed)[is_cone[beside[:, 0]] != is_cone[beside[:, 1]]]
        if len(is_cone) > real
        else np.zeros((0, 2), np.int32)
    )
    fine = isotropic(closed, edge, rounds, features=rim, project=True, fixed=fixed)
    if not len(rim):
        return fine, np.ones(len(fine.faces), dtype=bool)
    looks_real = SurfaceDistance(closed).nearest(fine.vertices[fine.faces].mean(axis=1)).face < real
    return fine, _majority(fine, looks_real, _on_polyline(fine.vertices, closed.vertices[rim]))


def _majority(mesh: TriangleMesh, vote: NDArray[np.bool_], on_rim: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the vote of most of the area of each patch between rim edges, for each of its faces, shape (F,).

    A single face may vote wrongly where a cone passes close to the surface; its patch does not.
    """
    beside = edge_faces(mesh)
    inner = ~on_rim[edges(mesh)].all(axis=1) & (beside[:, 1] >= 0)
    count = len(mesh.faces)
    graph = coo_matrix((np.ones(int(inner.sum()), np.int8), (beside[inner, 0], beside[inner, 1])), (count, count))
    patches, patch = connected_components(graph, directed=False)
    area = face_areas(mesh)
    return (np.bincount(patch, np.where(vote, area, -area), patches) > 0.0)[patch]


def _on_polyline(points: FloatArray, segments: FloatArray) -> NDArray[np.bool_]:
    """Return which points (N, 3) lie on one of the segments (S, 2, 3)."""
    import igl

    vertices = np.ascontiguousarray(segments.reshape(-1, 3))
    lines = np.arange(len(vertices), dtype=np.int64).reshape(-1, 2)
    squared, _, _ = igl.point_mesh_squared_distance(points, vertices, lines)
    return squared < ON_RIM**2


def _openings_and_pieces(mesh: TriangleMesh) -> tuple[int, int]:
    return len(boundary_loops(mesh)), face_components(mesh)[0]


def _broken(before: TriangleMesh, after: TriangleMesh) -> str:
    """Return in words why a result is of no use, if it is not."""
    if not is_manifold(after):
        return "remeshing broke the surface: it is no manifold"
    was, now = _openings_and_pieces(before), _openings_and_pieces(after)
    return "" if was == now else f"remeshing broke the surface: (openings, pieces) were {was} and are {now}"


def _measure(before: TriangleMesh, after: TriangleMesh, rim_change: float, job: Job) -> None:
    """Measure what remeshing changed."""
    there = SurfaceDistance(after).nearest(before.vertices).distance
    back = SurfaceDistance(before).nearest(after.vertices).distance
    length = edge_lengths(after)
    job.measure(
        vertices=len(after.vertices),
        faces=len(after.faces),
        edge_median_mm=float(np.median(length) * 1e3),
        edge_p5_mm=float(np.percentile(length, 5) * 1e3),
        edge_p95_mm=float(np.percentile(length, 95) * 1e3),
        hausdorff_mm=float(max(there.max(), back.max()) * 1e3),
        deviation_rms_mm=float(np.sqrt(np.mean(there**2)) * 1e3),
        opening_change=rim_change,
        area_change=surface_area(after) / surface_area(before) - 1.0,
    )
