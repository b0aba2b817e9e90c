"""Outlines of a body in a picture and of the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from vto_pipeline.model.arrays import FloatArray, IntArray

_AWAY_PX = 0.75


@dataclass(frozen=True)
class Camera:
    """A level pinhole at the origin that looks along -Z.

    Args:
        focal: [px].
        width, height: Of the picture [px].
        drop: How far the principal point lies below the picture's middle, as that of a cropped photo may [px].
    """

    focal: float
    width: int
    height: int
    drop: float = 0.0

    @property
    def middle(self) -> FloatArray:
        """Principal point [px], shape (2,); (0, 0) is the centre of the first pixel."""
        return np.array([(self.width - 1) / 2, (self.height - 1) / 2 + self.drop])

    def project(self, points: FloatArray) -> FloatArray:
        """Return column and row of points in front of the camera [px], shape (N, 2)."""
        return self.middle + self.focal * points[:, :2] * [1.0, -1.0] / -points[:, 2:]

    def pull_back(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the derivative of normal . projection by the points [px/m], shape (N, 3)."""
        scale = self.focal / -points[:, 2]
        along = (normals[:, 0] * points[:, 0] - normals[:, 1] * points[:, 1]) / -points[:, 2]
        return scale[:, None] * np.stack([normals[:, 0], -normals[:, 1], along], axis=1)


@dataclass(frozen=True)
class ModelOutline:
    """Points of the model on the rim of its silhouette: middles of mesh edges.

    Args:
        edges: Both vertices of each edge, shape (N, 2).
        at: Column and row [px], shape (N, 2).
        normals: Unit, out of the silhouette, shape (N, 2).
    """

    edges: IntArray
    at: FloatArray
    normals: FloatArray


def model_outline(vertices: FloatArray, faces: IntArray, camera: Camera) -> ModelOutline:
    """Return the rim of a closed surface's silhouette.

    An edge between a face that looks at the camera and one that does not is a candidate. It is on the rim when nothing
    covers the point just outside of it: the winding number of all candidates there, which counts the layers of faces
    that look at the camera, is zero.

    Args:
        vertices: In the camera's frame [m], shape (V, 3).
        faces: Of a closed surface, shape (F, 3).
        camera: Where it is seen from.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    facing = (np.cross(b - a, c - a) * a).sum(axis=1) < 0  # the camera is the origin
    half = np.concatenate([faces[facing][:, [0, 1]], faces[facing][:, [1, 2]], faces[facing][:, [2, 0]]]).astype(
        np.int64
    )
    count = len(vertices)
    key = half.min(axis=1) * count + half.max(axis=1)
    _, first, times = np.unique(key, return_index=True, return_counts=True)
    edges = half[first[times == 1]]
    place = camera.project(vertices)
    start, end = place[edges[:, 0]], place[edges[:, 1]]
    step = end - start
    length = np.linalg.norm(step, axis=1)
    edges, start, end, step, length = (x[length > 0] for x in (edges, start, end, step, length))
    # counter-clockwise seen from outside; rows grow downwards: the silhouette lies to the right, outside to the left
    normals = np.stack([-step[:, 1], step[:, 0]], axis=1) / length[:, None]
    middle = (start + end) / 2
    bare = _layers(middle + _AWAY_PX * normals, start, end) == 0
    return ModelOutline(edges[bare].astype(np.int32), middle[bare], normals[bare])


def _layers(points: FloatArray, start: FloatArray, end: FloatArray) -> NDArray[np.int64]:
    """Winding number of oriented segments about points, by the crossings of a ray along +x (Sunday 2001)."""
    x, y = points[:, :1], points[:, 1:]
    down = (start[:, 1] <= y) & (end[:, 1] > y)
    up = (end[:, 1] <= y) & (start[:, 1] > y)
    side = (end[:, 0] - start[:, 0]) * (y - start[:, 1]) - (x - start[:, 0]) * (end[:, 1] - start[:, 1])
    return np.abs((down & (side > 0)).sum(axis=1) - (up & (side < 0)).sum(axis=1))


class ImageOutline:
    """A silhouette in a picture: signed distance from its rim, and the rim's points."""

    def __init__(self, mask: NDArray[np.bool_]) -> None:
        inside, outside = distance_transform_edt(mask), distance_transform_edt(~mask)
        # pixels are squares: the rim runs half a pixel beyond the last centre inside
        self._distance = np.where(mask, 0.5 - inside, outside - 0.5)
        row, column = np.nonzero(mask & (inside < 1.5))
        self.points = np.stack([column, row], axis=1).astype(float)
        value, self.normals = self.distance(self.points)
        self.points = self.points - value[:, None] * self.normals

    def distance(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return signed distance from the rim [px], positive outside, and its unit gradient, shapes (N,) and (N, 2)."""
        value = self._at(points)
        slope = np.stack([self._at(points + h) - self._at(points - h) for h in np.eye(2)], axis=1)
        return value, slope / (np.linalg.norm(slope, axis=1, keepdims=True) + 1e-9)

    def _at(self, points: FloatArray) -> FloatArray:
        values: FloatArray = map_coordinates(self._distance, points[:, ::-1].T, order=1, mode="nearest")
        return values
