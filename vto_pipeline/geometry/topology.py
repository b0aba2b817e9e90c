"""Adjacency in a triangle mesh: edges, hinges, boundary loops, components, pieces, normals.

A half-edge 3f+k runs from corner k to corner k+1 of face f. Results never depend on hash order.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.vector import axpy, cross, dot, load, store, sub, unit


def half_edges(mesh: TriangleMesh) -> IntArray:
    """Return start and end vertex of each half-edge, shape (3F, 2)."""
    return np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)


def edges(mesh: TriangleMesh) -> IntArray:
    """Return each edge once, the smaller vertex first, in lexicographic order, shape (E, 2)."""
    return _unique_edges(mesh)[0]


def edge_face_counts(mesh: TriangleMesh) -> tuple[IntArray, IntArray]:
    """Return the edges, shape (E, 2), and how many faces hold each, shape (E,)."""
    found, edge_of_half = _unique_edges(mesh)
    return found, np.bincount(edge_of_half, minlength=len(found)).astype(np.int32)


def laid_edge_lengths(mesh: TriangleMesh, corners: FloatArray) -> FloatArray:
    """Return the length of each of `edges(mesh)` where its faces have these corners, shape (E,).

    Args:
        mesh: Its triangles.
        corners: Of each face for itself [m], shape (F, 3, D); an edge is as long as its faces have it on average.
    """
    found, edge_of_half = _unique_edges(mesh)
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).reshape(-1)
    total = np.bincount(edge_of_half, sides, len(found))
    return np.asarray(total / np.bincount(edge_of_half, minlength=len(found)))


def edge_faces(mesh: TriangleMesh) -> IntArray:
    """Return the faces beside each of `edges(mesh)`, shape (E, 2); -1 beyond a boundary.

    Raises:
        InputError: an edge with more than two faces.
    """
    found, edge_of_half = _unique_edges(mesh)
    _check_manifold(edge_of_half, len(found))
    faces = np.full((len(found), 2), -1, dtype=np.int32)
    order = np.argsort(edge_of_half, kind="stable")
    first = np.searchsorted(edge_of_half[order], np.arange(len(found)))
    faces[:, 0] = order[first] // 3
    paired = np.bincount(edge_of_half, minlength=len(found)) == 2
    faces[paired, 1] = order[first[paired] + 1] // 3
    return faces


def opposite_half_edges(mesh: TriangleMesh) -> IntArray:
    """Return the half-edge running the other way along the same edge, shape (3F,); -1 at a boundary.

    Raises:
        InputError: an edge with more than two faces, or two faces that run the same way along an edge.
    """
    halves = half_edges(mesh)
    found, edge_of_half = _unique_edges(mesh)
    _check_manifold(edge_of_half, len(found))
    order = np.argsort(edge_of_half, kind="stable")
    same = np.flatnonzero(np.diff(edge_of_half[order]) == 0)
    one, other = order[same], order[same + 1]
    if (halves[one, 0] == halves[other, 0]).any():
        raise InputError("neighbouring faces are oriented against each other", hint="run geometry.repair first")
    opposite = np.full(len(halves), -1, dtype=np.int32)
    opposite[one], opposite[other] = other, one
    return opposite


def boundary_walks(mesh: TriangleMesh) -> list[IntArray]:
    """Return the boundary loops as ordered half-edges, each running as its faces do.

    Where two loops touch in a vertex, each stays with its own fan of faces. A loop starts at its smallest
    half-edge and the list is in the order of these.

    Raises:
        InputError: an edge with more than two faces, or badly oriented neighbours.
    """
    walk, lengths = _walk_boundary(opposite_half_edges(mesh))
    return np.split(walk, np.cumsum(lengths)[:-1]) if len(lengths) else []


def boundary_loops(mesh: TriangleMesh) -> list[IntArray]:
    """Return the boundary loops as ordered vertex indices: the starts of `boundary_walks`.

    Raises:
        InputError: an edge with more than two faces, or badly oriented neighbours.
    """
    start = half_edges(mesh)[:, 0]
    return [start[walk] for walk in boundary_walks(mesh)]


def close_openings(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh with a fan over each opening."""
    vertices, faces = [mesh.vertices], [mesh.faces]
    count = len(mesh.vertices)
    for loop in boundary_loops(mesh):
        vertices.append(mesh.vertices[loop].mean(axis=0, keepdims=True))
        faces.append(np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), count)]).astype(np.int32))
        count += 1
    return TriangleMesh(np.vstack(vertices), np.vstack(faces))


def hinges(mesh: TriangleMesh) -> IntArray:
    """Return (v0, v1, a, b) for each inner edge, shape (H, 4): face (v0, v1, a) and face (v1, v0, b).

    Raises:
        InputError: an edge with more than two faces, or badly oriented neighbours.
    """
    corner = mesh.faces.reshape(-1)
    one, other = corners_from(hinge_halves(mesh)).transpose(1, 2, 0)
    return np.stack([corner[one[0]], corner[one[1]], corner[one[2]], corner[other[2]]], axis=1).astype(np.int32)


def hinge_halves(mesh: TriangleMesh) -> IntArray:
    """Return the two half-edges of each of `hinges(mesh)`, shape (H, 2).

    Raises:
        InputError: an edge with more than two faces, or badly oriented neighbours.
    """
    opposite = opposite_half_edges(mesh)
    half = np.flatnonzero(opposite > np.arange(len(opposite)))
    return np.column_stack([half, opposite[half]]).astype(np.int32)


def corners_from(half: IntArray) -> IntArray:
    """Return the corners (0 to 3F) of the faces of half-edges, from its start on: start, end, apex, shape (..., 3)."""
    first = 3 * (half // 3)
    return np.stack([half, first + (half + 1) % 3, first + (half + 2) % 3], axis=-1)


def face_components(mesh: TriangleMesh) -> tuple[int, IntArray]:
    """Return the number of components connected through edges, and the component of each face, shape (F,)."""
    found, edge_of_half = _unique_edges(mesh)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    incidence = coo_matrix((np.ones(len(face), np.int8), (face, edge_of_half)), (len(mesh.faces), len(found))).tocsr()
    count, label = connected_components(incidence @ incidence.T, directed=False)
    return int(count), label.astype(np.int32)


def submesh(mesh: TriangleMesh, keep: NDArray[np.bool_]) -> tuple[TriangleMesh, IntArray]:
    """Return the kept faces as a mesh of their own, and the old index of each of its vertices, shape (V',).

    Args:
        mesh: The whole.
        keep: Which faces, shape (F,).

    Raises:
        InputError: no face is kept.
    """
    faces = mesh.faces[keep]
    source, flat = np.unique(faces, return_inverse=True)
    colors = None if mesh.colors is None else mesh.colors[source]
    return TriangleMesh(mesh.vertices[source], flat.reshape(-1, 3).astype(np.int32), colors), source.astype(np.int32)


def concatenate(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return meshes as one, in their order, not welded and without colours."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + np.int32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def component_areas(mesh: TriangleMesh) -> tuple[IntArray, FloatArray]:
    """Return the piece of each face, as `face_components`, shape (F,), and the area of each piece [m²], shape (P,)."""
    count, piece = face_components(mesh)
    return piece, np.asarray(np.bincount(piece, face_areas(mesh), count), dtype=np.float64)


def surface_area(mesh: TriangleMesh) -> float:
    """Return the area of all faces together [m²]."""
    return float(face_areas(mesh).sum())


def face_areas(mesh: TriangleMesh) -> FloatArray:
    """Return the area of each face [m²], shape (F,)."""
    return np.asarray(np.linalg.norm(face_area_vectors(mesh), axis=1))


def face_area_vectors(mesh: TriangleMesh) -> FloatArray:
    """Return the normal of each face times its area [m²], shape (F, 3)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def face_normals(mesh: TriangleMesh) -> FloatArray:
    """Return the unit normal of each face, shape (F, 3); zero for a face without area."""
    return _unit(face_area_vectors(mesh))


def vertex_normals(mesh: TriangleMesh) -> FloatArray:
    """Return unit vertex normals weighted by the angle of each corner, shape (V, 3).

    Thürmer and Wüthrich 1998. Zero where a vertex has no face.
    """
    normals: FloatArray = _vertex_normals(mesh.vertices, mesh.faces)
    return normals


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)


def _unique_edges(mesh: TriangleMesh) -> tuple[IntArray, NDArray[np.int64]]:
    """Return the edges in lexicographic order, shape (E, 2), and the edge of each half-edge, shape (3F,)."""
    halves = half_edges(mesh).astype(np.int64)
    key = halves.min(axis=1) * len(mesh.vertices) + halves.max(axis=1)
    unique, edge_of_half = np.unique(key, return_inverse=True)
    return np.column_stack(np.divmod(unique, len(mesh.vertices))).astype(np.int32), edge_of_half


def _check_manifold(edge_of_half: NDArray[np.int64], count: int) -> None:
    crowded = int((np.bincount(edge_of_half, minlength=count) > 2).sum())
    if crowded:
        raise InputError(f"{crowded} edges have more than two faces", hint="run geometry.repair first")


@njit(cache=True)
def _walk_boundary(opposite):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return boundary half-edges (B,) loop after loop, and the length of each loop (L,)."""
    count = 0
    for h in range(len(opposite)):
        if opposite[h] < 0:
            count += 1
    walk = np.empty(count, np.int32)
    lengths = np.empty(count, np.int64)
    seen = np.zeros(len(opposite), np.bool_)
    filled = loops = 0
    for start in range(len(opposite)):
        if opposite[start] >= 0 or seen[start]:
            continue
        first, h = filled, start
        while not seen[h]:
            seen[h] = True
            walk[filled] = h
            filled += 1
            h = 3 * (h // 3) + (h + 1) % 3
            while opposite[h] >= 0:  # turn about the end vertex, inside its fan of faces
                h = opposite[h]
                h = 3 * (h // 3) + (h + 1) % 3
        lengths[loops] = filled - first
        loops += 1
    return walk, lengths[:loops]


@njit(cache=True, error_model="numpy")
def _vertex_normals(x, faces):  # type: ignore[no-untyped-def]  # typed by Numba
    normals = np.zeros_like(x)
    for f in range(len(faces)):
        i, j, k = load(faces, f)
        a, b, c = load(x, i), load(x, j), load(x, k)
        ab, bc, ca = unit(sub(b, a)), unit(sub(c, b)), unit(sub(a, c))
        normal = unit(cross(sub(b, a), sub(c, a)))
        for v, cosine in ((i, -dot(ab, ca)), (j, -dot(bc, ab)), (k, -dot(ca, bc))):
            store(normals, v, axpy(acos(min(max(cosine, -1.0), 1.0)), normal, load(normals, v)))
    for v in range(len(normals)):
        store(normals, v, unit(load(normals, v)))
    return normals
