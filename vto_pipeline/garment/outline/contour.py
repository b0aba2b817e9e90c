"""The outline of a mesh in a picture: points on its contour edges that can be seen.

A contour edge lies between a face that looks at the camera and one that looks away. It is seen where neither the mesh
itself nor what was scanned lies before it; where the scan lies just behind, it is cloth over the mannequin, and the
outline in the picture is the cloth's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.garment.outline.edges import EdgeLevel
from vto_pipeline.geometry.topology import edge_face_counts, face_normals, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise_depth

SPACING = 2.0
"""Distance of points along the outline [px]."""
COVERED = 0.06
"""What was scanned this far behind the outline belongs to it still [share of the mannequin's size]."""
BEHIND = 0.003
"""Depths differ by this where the same place is meant [share of the mannequin's size]."""


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
        local = self.mesh.vertices @ cam_from_mesh[:3, :3].T + cam_from_mesh[:3, 3]
        eye = -np.linalg.solve(cam_from_mesh[:3, :3], cam_from_mesh[:3, 3])
        toward: NDArray[np.bool_] = _toward(self.normals, self.mesh.vertices, self.mesh.faces, eye)
        z = local[:, 2]
        ahead: NDArray[np.bool_] = np.asarray(z > 0.05 * scale * self.size)
        safe = np.where(ahead, z, 1.0)
        pixel = np.column_stack(
            [camera.fx * local[:, 0] / safe + camera.cx, camera.fy * local[:, 1] / safe + camera.cy, z]
        )
        whole: NDArray[np.bool_] = (
            np.ones(len(self.mesh.faces), bool) if ahead.all() else np.asarray(ahead[self.mesh.faces].all(axis=1))
        )
        depth = rasterise_depth(pixel, self.mesh.faces[whole & toward], camera.width, camera.height)
        rim = (toward[self.beside[:, 0]] != toward[self.beside[:, 1]]) & whole[self.beside].all(axis=1)
        pair = self.edges[rim]
        front = np.where(toward[self.beside[rim, 0]], self.beside[rim, 0], self.beside[rim, 1])
        third = self.mesh.faces[front].sum(axis=1) - pair.sum(axis=1)
        edge, along, at, outward, length = _seen(
            pixel[pair], pixel[third], depth, level.hidden, BEHIND * scale * self.size, COVERED * scale * self.size
        )
        ends, far = pair[edge], along[:, None]
        point = (1 - far) * self.mesh.vertices[ends[:, 0]] + far * self.mesh.vertices[ends[:, 1]]
        return Contour(point, at[:, :2], outward, at[:, 2], length)


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
def _toward(normals, vertices, faces, eye):  # type: ignore[no-untyped-def]  # typed by Numba
    """Which faces look at the eye, shape (F,)."""
    toward = np.empty(len(faces), np.bool_)
    for f in range(len(faces)):
        first, facing = vertices[faces[f, 0]], 0.0
        for d in range(3):
            facing += normals[f, d] * (eye[d] - first[d])
        toward[f] = facing > 0.0
    return toward


@njit(cache=True, nogil=True)
def _seen(ends, third, depth, hidden, behind, covered):  # type: ignore[no-untyped-def]  # typed by Numba
    """Points along projected edges that nothing hides.

    Args:
        ends: Column, row, depth of both ends of each edge, shape (E, 2, 3).
        third: The same of the third corner of the face that looks at the camera, shape (E, 3).
        depth: Of the mesh, shape (H, W).
        hidden: Of the scan, shape (H, W).
        behind: Depths differ by no more than this at the same place.
        covered: The scan may lie so far behind and still cover.

    Returns:
        Edge, place along it (0 to 1), column, row and depth, outward normal, length [px] of each point.
    """
    height, width = depth.shape
    total = 0
    counts = np.zeros(len(ends), np.int64)
    for e in range(len(ends)):
        long = np.hypot(ends[e, 1, 0] - ends[e, 0, 0], ends[e, 1, 1] - ends[e, 0, 1])
        if 1e-9 < long < 4.0 * (width + height):
            counts[e] = int(np.ceil(long / SPACING))
            total += counts[e]
    edge, along = np.empty(total, np.int64), np.empty(total)
    at, outward, length = np.empty((total, 3)), np.empty((total, 2)), np.empty(total)
    n = 0
    for e in range(len(ends)):
        if counts[e] == 0:
            continue
        a, b = ends[e, 0], ends[e, 1]
        long = np.hypot(b[0] - a[0], b[1] - a[1])
        nx, ny = (b[1] - a[1]) / long, -(b[0] - a[0]) / long
        if nx * (third[e, 0] - a[0]) + ny * (third[e, 1] - a[1]) > 0:
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
            edge[n], along[n], length[n] = e, t, long / counts[e]
            at[n, 0], at[n, 1], at[n, 2] = u, v, z
            outward[n, 0], outward[n, 1] = nx, ny
            n += 1
    return edge[:n], along[:n], at[:n], outward[:n], length[:n]
