"""The outline of a mesh in a picture: points on its contour edges that can be seen.

A contour edge lies between a face that looks at the camera and one that looks away. It is seen where neither the mesh
itself nor what was scanned lies before it; where the scan lies just behind, it is cloth over the mannequin, and the
outline in the picture is the cloth's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from vto_pipeline.garment.outline.edges import EdgeLevel
from vto_pipeline.geometry.topology import edge_face_counts, face_normals, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import projected, rasterise_depth

SPACING = 2.0
"""Distance of points along the outline [px]."""
COVERED = 0.06
"""What was scanned this far behind the outline belongs to it still [share of the mannequin's size]."""
BEHIND = 0.003
"""Depths differ by this where the same place is meant [share of the mannequin's size]."""
TOWARD, AWAY, CUT = 1, 0, -1
"""A face looks toward the camera or away, or part of it is not before the camera."""


class Contour(NamedTuple):
    """Points of an outline.

    Args:
        point: On the mesh, in the mesh's own frame, shape (N, 3).
        pixel: Column and row, shape (N, 2).
        outward: Unit normal in the picture, away from the mesh, shape (N, 2).
        depth: Along the optical axis, shape (N,).
        length: What each stands for [px], shape (N,).
    """

    point: FloatArray
    pixel: FloatArray
    outward: FloatArray
    depth: FloatArray
    length: FloatArray


class ContourMesh:
    """A closed or open mesh prepared for outlines.

    Args:
        mesh: Oriented outward.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        self.normals = face_normals(mesh)
        self.edges, self.beside = _inner_edges(mesh)

    def contour(self, cam_from_mesh: FloatArray, level: EdgeLevel) -> Contour:
        """Return the visible outline.

        Args:
            cam_from_mesh: A similarity, shape (4, 4).
            level: The picture.
        """
        camera, scale = level.camera, float(np.cbrt(np.linalg.det(cam_from_mesh[:3, :3])))
        size = scale * self.size
        lens = (camera.fx, camera.fy, camera.cx, camera.cy)
        vertices, faces = self.mesh.vertices, self.mesh.faces
        pixel = projected(vertices, cam_from_mesh, lens, 0.05 * size)
        eye = -np.linalg.solve(cam_from_mesh[:3, :3], cam_from_mesh[:3, 3])
        side = _sides(self.normals, vertices, faces, pixel, eye)
        depth = rasterise_depth(pixel, faces[side == TOWARD], camera.width, camera.height)
        pair, third = _rim(self.edges, self.beside, faces, side)
        return Contour(*_seen(vertices, pixel, pair, third, depth, level.hidden, BEHIND * size, COVERED * size))


def _inner_edges(mesh: TriangleMesh) -> tuple[IntArray, IntArray]:
    """Edges with two faces, shape (E, 2), and those faces, shape (E, 2); others have no inside and outside."""
    edges, count = edge_face_counts(mesh)
    halves = np.sort(half_edges(mesh), axis=1)
    order = np.lexsort((halves[:, 1], halves[:, 0]))
    first = np.cumsum(count) - count
    inner = count == 2
    face = order // 3
    return edges[inner], np.column_stack([face[first[inner]], face[first[inner] + 1]]).astype(np.int32)


@njit(cache=True, nogil=True)
def _sides(normals, vertices, faces, pixel, eye):  # type: ignore[no-untyped-def]  # typed by Numba
    """Whether each face looks toward the eye or away, or is not whole before the camera, shape (F,)."""
    sides = np.empty(len(faces), np.int8)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        facing = 0.0
        for d in range(3):
            facing += normals[f, d] * (eye[d] - vertices[a, d])
        sides[f] = TOWARD if facing > 0.0 else AWAY
        if not (pixel[a, 2] > 0.0 and pixel[b, 2] > 0.0 and pixel[c, 2] > 0.0):
            sides[f] = CUT
    return sides


@njit(cache=True, nogil=True)
def _rim(edges, beside, faces, sides):  # type: ignore[no-untyped-def]  # typed by Numba
    """Edges (E, 2) between a face that looks toward the eye and one that looks away, and the former's third corner."""
    pair, third = np.empty_like(edges), np.empty(len(edges), edges.dtype)
    n = 0
    for e in range(len(edges)):
        one, other = sides[beside[e, 0]], sides[beside[e, 1]]
        if one == other or CUT in (one, other):
            continue
        front = beside[e, 0] if one == TOWARD else beside[e, 1]
        a, b = edges[e, 0], edges[e, 1]
        pair[n, 0], pair[n, 1] = a, b
        third[n] = faces[front, 0] + faces[front, 1] + faces[front, 2] - a - b
        n += 1
    return pair[:n], third[:n]


@njit(cache=True, nogil=True)
def _seen(vertices, pixel, pair, third, depth, hidden, behind, covered):  # type: ignore[no-untyped-def]  # typed by Numba
    """Points along projected edges that nothing hides, as of `Contour`.

    Args:
        vertices: Shape (V, 3).
        pixel: Column, row, depth of each, shape (V, 3).
        pair: Both ends of each edge, shape (E, 2).
        third: The third corner of the face that looks toward the camera, shape (E,).
        depth: Of the mesh, shape (H, W).
        hidden: Of the scan, shape (H, W).
        behind: Depths differ by no more than this at the same place.
        covered: The scan may lie so far behind and still cover.
    """
    height, width = depth.shape
    total = 0
    counts = np.zeros(len(pair), np.int64)
    for e in range(len(pair)):
        a, b = pixel[pair[e, 0]], pixel[pair[e, 1]]
        long = np.hypot(b[0] - a[0], b[1] - a[1])
        if 1e-9 < long < 4.0 * (width + height):
            counts[e] = int(np.ceil(long / SPACING))
            total += counts[e]
    point, at, outward = np.empty((total, 3)), np.empty((total, 2)), np.empty((total, 2))
    away, length = np.empty(total), np.empty(total)
    n = 0
    for e in range(len(pair)):
        if counts[e] == 0:
            continue
        a, b, c = pixel[pair[e, 0]], pixel[pair[e, 1]], pixel[third[e]]
        long = np.hypot(b[0] - a[0], b[1] - a[1])
        nx, ny = (b[1] - a[1]) / long, -(b[0] - a[0]) / long
        if nx * (c[0] - a[0]) + ny * (c[1] - a[1]) > 0:
            nx, ny = -nx, -ny
        for k in range(counts[e]):
            t = (k + 0.5) / counts[e]
            u, v, z = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
            column, row = int(np.round(u + 1.5 * nx)), int(np.round(v + 1.5 * ny))
            if not (2 <= column < width - 2 and 2 <= row < height - 2 and 2 <= u < width - 2 and 2 <= v < height - 2):
                continue
            if depth[row, column] < z + behind:
                continue
            if hidden[int(np.round(v)), int(np.round(u))] < z + covered:
                continue
            for d in range(3):
                point[n, d] = (1 - t) * vertices[pair[e, 0], d] + t * vertices[pair[e, 1], d]
            at[n, 0], at[n, 1], away[n] = u, v, z
            outward[n, 0], outward[n, 1], length[n] = nx, ny, long / counts[e]
            n += 1
    return point[:n], at[:n], outward[:n], away[:n], length[:n]
