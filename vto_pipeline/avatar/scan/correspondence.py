"""Correspondences of model and scan: closest points in both directions, with robust weights."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.topology import edge_face_counts, face_normals, vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_AGREE = 0.5
_NO_WEIGHT = 1e-6
_MUTUAL = 0.5
"""Share of a vertex's distance to the scan: a place nearer than this to another part of the body belongs there."""
_THROUGH_M = 0.003
"""A point this little inside the model still counts as outside: else bare skin would push the model by its noise."""


@dataclass(frozen=True)
class Correspondences:
    """Points of the model and the tangent planes of the scan they should lie on.

    Args:
        corners: The model's vertices, shape (N, 3).
        shares: Barycentric, shape (N, 3).
        targets: Points on the scan [m], shape (N, 3).
        normals: Unit normals, shape (N, 3).
        weights: Shape (N,).
    """

    corners: NDArray[np.int64]
    shares: FloatArray
    targets: FloatArray
    normals: FloatArray
    weights: FloatArray

    def weighted(self) -> Correspondences:
        """Return only the pairs that have a weight."""
        kept = self.weights > _NO_WEIGHT
        return Correspondences(
            self.corners[kept], self.shares[kept], self.targets[kept], self.normals[kept], self.weights[kept]
        )


class Target:
    """A scan prepared for closest points.

    Args:
        scan: In metres, +Y up.
        probes: Points of it that are matched with the model.
        seed: Of their places.
    """

    def __init__(self, scan: TriangleMesh, probes: int, seed: int) -> None:
        self._outside = 1.0
        self.vertices, self.faces = scan.vertices, scan.faces
        self.face_normals = face_normals(scan)
        self.probes, self.probe_normals, _ = sample_surface(scan, probes, seed)
        edges, count = edge_face_counts(scan)
        rim = np.zeros(len(scan.vertices), dtype=bool)
        rim[edges[count == 1].ravel()] = True
        self._rim_face: NDArray[np.bool_] = np.any(rim[scan.faces], axis=1)

    def as_clothes(self, outside: float) -> Target:
        """Return the same as clothes: what lies outside the model counts only so much, 0 to 1, what inside all."""
        clothes = copy(self)
        clothes._outside = outside
        return clothes

    def closest_on_scan(
        self, vertices: FloatArray, faces: IntArray, chosen: NDArray[np.int64], normals: FloatArray, reach: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return closest scan points of a body's vertices, their normals, and weights.

        These are 0 beyond reach, across the surface, at a rim, and where another part of the body is nearer to that
        place: what the scan lacks, as an arm, would else be drawn to what lies beside it. (Correspondences must be
        mutual; Pajdla & Van Gool 1995.)

        Args:
            vertices, faces: The body [m].
            chosen: Which vertices, shape (N,).
            normals: Theirs, shape (N, 3).
            reach: Distance at which a point begins to count little [m].
        """
        points = vertices[chosen]
        face, closest, distance = closest_points(points, self.vertices, self.faces)
        agree = (normals * self.face_normals[face]).sum(axis=1) > _AGREE
        own = closest_points(closest, vertices, faces)[2] >= _MUTUAL * distance
        weight = geman_mcclure(distance, reach) * (agree & own & ~self._rim_face[face] & (distance < 3 * reach))
        weight *= self.side_weight(((closest - points) * normals).sum(axis=1))
        return closest, self.face_normals[face], weight

    def side_weight(self, ahead: FloatArray) -> FloatArray:
        """Return the weight of points of the scan by how far outside the model they lie [m], negative inside."""
        return np.where(ahead > -_THROUGH_M, self._outside, 1.0)

    def pairs(self, vertices: FloatArray, faces: IntArray, chosen: NDArray[np.int64], reach: float) -> Correspondences:
        """Match probes of the scan with the model, and chosen vertices of the model with the scan."""
        body = TriangleMesh(vertices, faces)
        normal = face_normals(body)
        face, closest, distance = closest_points(self.probes, vertices, faces)
        agree = (normal[face] * self.probe_normals).sum(axis=1) > _AGREE
        weight = geman_mcclure(distance, reach) * (agree & (distance < 3 * reach))
        weight *= self.side_weight(((self.probes - closest) * normal[face]).sum(axis=1))
        shares = barycentric(closest, vertices[faces[face]])
        facing = vertex_normals(body)[chosen]
        at, ahead, pull = self.closest_on_scan(vertices, faces, chosen, facing, reach)
        return Correspondences(
            np.concatenate([faces[face], np.repeat(chosen[:, None], 3, axis=1)]).astype(np.int64),
            np.concatenate([shares, np.tile([1.0, 0.0, 0.0], (len(chosen), 1))]),
            np.concatenate([self.probes, at]),
            np.concatenate([normal[face], ahead]),
            np.concatenate([weight, pull]),
        )


def geman_mcclure(distance: FloatArray, scale: float) -> FloatArray:
    """Return robust weights of distances, 1 at zero, falling beyond the scale (Geman & McClure 1987)."""
    return 1 / (1 + (distance / scale) ** 2) ** 2
