"""Where a plane cuts a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class Section:
    """The curves in which a plane meets a mesh.

    Args:
        ends: The mesh edge on which each point lies, as two vertices, shape (N, 2).
        share: How far along that edge the point is, 0 to 1, shape (N,).
        points: Where that is [m], shape (N, 3).
        segments: Neighbours along the curves, shape (S, 2).
        curve: Which curve each point belongs to, shape (N,).
    """

    ends: IntArray
    share: FloatArray
    points: FloatArray
    segments: IntArray
    curve: IntArray

    def parts(self) -> list[NDArray[np.intp]]:
        """Return the points of each closed curve, and last those of all open curves together.

        Open curves come from an open front, or from what was cut away (a sleeve), and belong to one way around.
        """
        loose = np.bincount(self.segments.ravel(), minlength=len(self.points)) != 2
        count = int(self.curve.max()) + 1 if len(self.curve) else 0
        is_open = np.bincount(self.curve, loose, count) > 0
        closed = [np.flatnonzero(self.curve == k) for k in np.flatnonzero(~is_open)]
        return [*closed, np.flatnonzero(is_open[self.curve])] if is_open.any() else closed

    def is_closed(self, part: NDArray[np.intp]) -> bool:
        """Whether a part runs back into itself without loose ends."""
        degree = np.bincount(self.segments.ravel(), minlength=len(self.points))
        return bool((degree[part] == 2).all())

    def length(self, part: NDArray[np.intp], vertices: FloatArray) -> float:
        """Length of a part [m] when the mesh has these vertices [m], shape (V, 3), for example its rest positions."""
        a, b = vertices[self.ends[:, 0]], vertices[self.ends[:, 1]]
        points = a + self.share[:, None] * (b - a)
        segments = self.segments[np.isin(self.segments[:, 0], part)]
        return float(np.linalg.norm(points[segments[:, 0]] - points[segments[:, 1]], axis=1).sum())


def plane_section(
    mesh: TriangleMesh, origin: FloatArray, normal: FloatArray, keep: NDArray[np.bool_] | None = None
) -> Section:
    """Cut a mesh by a plane. A vertex on the plane counts as above it, so that no case is special.

    Args:
        mesh: Any triangles.
        origin: A point of the plane [m], shape (3,).
        normal: Its normal, any length, shape (3,).
        keep: Cut only these faces, shape (F,); default all.

    Returns:
        The curves; none when the plane misses the mesh. Curves are numbered by their first edge.
    """
    height = (mesh.vertices - origin) @ normal
    faces = mesh.faces if keep is None else mesh.faces[keep]
    above = height >= 0.0
    faces = faces[above[faces].any(axis=1) & ~above[faces].all(axis=1)]
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)  # (F, 3, 2)
    crossed = edges[above[edges[..., 0]] != above[edges[..., 1]]].reshape(-1, 2)  # two of each face's three
    ends, node = np.unique(crossed, axis=0, return_inverse=True)
    segments = node.reshape(-1, 2).astype(np.int32)
    one, other = height[ends[:, 0]], height[ends[:, 1]]
    share = one / (one - other)
    start = mesh.vertices[ends[:, 0]]
    points = start + share[:, None] * (mesh.vertices[ends[:, 1]] - start)
    links = coo_matrix((np.ones(len(segments)), (segments[:, 0], segments[:, 1])), shape=(len(ends), len(ends)))
    _, curve = connected_components(links, directed=False)
    return Section(ends.astype(np.int32), share, points, segments, curve.astype(np.int32))
