"""Triangles of one size: decimate, then split, collapse, flip and relax; the openings keep place and length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.geometry.remeshing.decimate import decimate, faces_at
from vto_pipeline.geometry.remeshing.isotropic import isotropic
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.rim_ears import flip_ears
from vto_pipeline.geometry.remeshing.small_rims import SMALL, even_small_rims
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import (
    boundary_loops,
    edge_faces,
    edges,
    face_area_vectors,
    face_components,
    submesh,
)
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

DECIMATE_TO = 5.0
"""A mesh much finer than wanted is first thinned to this many times the wanted number of faces."""

ON_RIM = 1e-7
"""Nearer than this to the old rim, a vertex is on it [m]; the remesher projects rim vertices onto it."""


class RemeshConfig(Config):
    """How fine the triangles become."""

    edge_mm: float = Field(default=10.0, ge=1, le=100, description="Target edge length [mm]")
    iterations: int = Field(default=10, ge=1, le=50, description="Rounds of split, collapse, flip, relax")


def remesh(mesh: TriangleMesh, config: RemeshConfig, job: Job) -> TriangleMesh:
    """Return the surface in near-equilateral triangles of one edge length.

    The remesher (`isotropic`) pins open boundaries as they are, and as `even_small_rims` has left the small ones. Each
    other opening is first closed by a cone, its rim marked as a feature along which vertices may slide, and the cones
    are taken away again at the end.

    Raises:
        InputError: the mesh is not manifold.
        GarmentError: the result is not manifold or has lost or won an opening.
    """
    if not is_manifold(mesh):
        raise InputError("mesh is not manifold", hint="run geometry.repair first")
    edge = config.edge_mm * 1e-3
    job.progress(0.0, "decimating")
    coarse = decimate(mesh, int(DECIMATE_TO * faces_at(mesh, edge)), aggressiveness=3.0)
    if not is_manifold(coarse) or _openings_and_pieces(coarse) != _openings_and_pieces(mesh):
        coarse = mesh  # slower, but whole
    coarse = even_small_rims(coarse, edge)
    closed = _close_with_cones(coarse, SMALL * edge)
    job.progress(0.3, "remeshing")
    fine, rim_faces = _remesh_closed(closed, len(coarse.faces), edge, config.iterations)
    result = flip_ears(submesh(fine, rim_faces)[0])
    _check(mesh, result, job)
    return result


def edge_lengths(mesh: TriangleMesh) -> FloatArray:
    """Return the length of each of `edges(mesh)` [m], shape (E,)."""
    pair = edges(mesh)
    return np.linalg.norm(mesh.vertices[pair[:, 0]] - mesh.vertices[pair[:, 1]], axis=1)


def perimeter(mesh: TriangleMesh, loop: NDArray[np.int32]) -> float:
    """Return the length of a closed loop of vertices [m]."""
    path = mesh.vertices[loop]
    return float(np.linalg.norm(path - np.roll(path, -1, axis=0), axis=1).sum())


def _close_with_cones(mesh: TriangleMesh, least: float) -> TriangleMesh:
    """Close each boundary loop longer than `least` [m] by a cone pointing away from the surface.

    The new vertices and faces come last.
    """
    tips, cones, count = [], [], len(mesh.vertices)
    for loop in boundary_loops(mesh):
        if perimeter(mesh, loop) < least:
            continue
        points = mesh.vertices[loop]
        middle = points.mean(axis=0)
        # The area over half the perimeter: a circle's cone is as high as its radius.
        area = -0.5 * np.cross(points - middle, np.roll(points, -1, axis=0) - middle).sum(axis=0)
        tips.append(middle + area / (0.5 * perimeter(mesh, loop)))
        cones.append(np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), count)]))
        count += 1
    return TriangleMesh(np.vstack([mesh.vertices, *tips]), np.vstack([mesh.faces, *cones]).astype(np.int32))


def _remesh_closed(closed: TriangleMesh, real: int, edge: float, rounds: int) -> tuple[TriangleMesh, NDArray[np.bool_]]:
    """Remesh a surface whose faces from `real` on are cones; return it and which new faces are not of a cone."""
    is_cone = np.arange(len(closed.faces)) >= real
    beside = edge_faces(closed)
    rim = (
        edges(closed)[is_cone[beside[:, 0]] != is_cone[beside[:, 1]]]
        if len(is_cone) > real
        else np.zeros((0, 2), np.int32)
    )
    fine = isotropic(closed, edge, rounds, features=rim, project=True)
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
    area = np.linalg.norm(face_area_vectors(mesh), axis=1)
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


def _check(before: TriangleMesh, after: TriangleMesh, job: Job) -> None:
    """Measure what remeshing changed, and refuse a result with other openings or pieces."""
    was, now = _openings_and_pieces(before), _openings_and_pieces(after)
    if not is_manifold(after) or was != now:
        raise GarmentError(
            f"remeshing broke the surface: (openings, pieces) were {was} and are {now}",
            hint="try an edge length well below the narrowest part of the garment",
        )
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
    )
