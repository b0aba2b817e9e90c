"""The part of a body that can be touched: without faces inside its other parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.nearest import Nearest
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_components, submesh
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.distance import EDGE, FACE, VERTEX

_BEFORE = 1e-6  # m: how far before its face a place is looked at
_LOOKS = 8  # faces looked at of a piece that crosses nothing: it is inside or outside as a whole
_CUTS = 3  # times that a face passing through another part is cut in four: what is left of it inside is an eighth long
_MIDDLE = np.full((1, 3), 1.0 / 3.0)
_PLACES = np.vstack([0.85 * np.eye(3) + 0.05, _MIDDLE])


class Touchable(NamedTuple):
    """The part of a body that can be touched: whole faces, then pieces of others.

    Args:
        vertices: Of the body, then of the pieces [m], shape (N, 3).
        faces: Shape (T, 3).
        parent: Face of the body that each is, or is a piece of, shape (T,).
        corners: Where in that the corners of the pieces are, barycentric, shape (P, 3, 3).
        passing: Whether a face of the body passes through another part, shape (F,).
        buried: How many faces of the body lie wholly inside it.
    """

    vertices: FloatArray
    faces: IntArray
    parent: IntArray
    corners: FloatArray
    passing: NDArray[np.bool_]
    buried: int

    def on_body(self, found: Nearest) -> Nearest:
        """Map places on these faces to the body's own faces."""
        whole = len(self.faces) - len(self.corners)
        triangle = np.where(found.triangle >= 0, self.parent[found.triangle], -1).astype(np.int32)
        pieces = np.flatnonzero(found.triangle >= whole)
        if len(pieces) == 0:
            return found._replace(triangle=triangle)
        weights = np.einsum("nk,nkm->nm", found.weights[pieces], self.corners[found.triangle[pieces] - whole])
        zero = weights == 0.0
        feature = np.where(zero.sum(axis=1) == 2, VERTEX + np.argmax(weights, axis=1), FACE)
        feature = np.where(zero.sum(axis=1) == 1, EDGE + (np.argmax(zero, axis=1) + 1) % 3, feature)
        there = Nearest(triangle[pieces], weights, feature.astype(np.int8))
        return found._replace(triangle=triangle).with_replaced(pieces, there)


def touchable(mesh: TriangleMesh, distance: SurfaceDistance) -> Touchable:
    """Return the touchable part of a body: without an arm's faces inside the torso or eyes behind their lids.

    A place is inside where the winding number before its face is above one half. Only faces of which no place looked at
    is outside are taken away: of those that pass through another part, four places, of what is left of them then four
    places of each of their pieces, and of a piece of the body that passes through nothing, its largest faces.

    Args:
        mesh: The body.
        distance: To it.
    """
    count = len(mesh.faces)
    passing = np.zeros(count, np.bool_)
    passing[self_intersections(mesh)] = True
    buried = _buried(mesh, distance, passing)
    whole = np.flatnonzero(~buried & ~passing)
    cut = np.flatnonzero(~buried & passing)
    corners = _cut_corners()
    parent = np.repeat(cut, len(corners))
    within = np.tile(corners, (len(cut), 1, 1))
    places = np.einsum("tkm,tmd->tkd", within, mesh.vertices[mesh.faces[parent]])
    kept = ~_inside(places, distance, _PLACES).all(axis=1)
    extra = len(mesh.vertices) + np.arange(3 * int(kept.sum())).reshape(-1, 3)
    return Touchable(
        np.vstack([mesh.vertices, places[kept].reshape(-1, 3)]),
        np.vstack([mesh.faces[whole], extra]).astype(np.int32),
        np.concatenate([whole, parent[kept]]).astype(np.int32),
        within[kept],
        passing,
        int(buried.sum()),
    )


def _buried(mesh: TriangleMesh, distance: SurfaceDistance, passing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which faces lie wholly inside other parts, shape (F,)."""
    buried = np.zeros(len(mesh.faces), np.bool_)
    whole = np.flatnonzero(~passing)
    if len(whole):
        count, piece = face_components(submesh(mesh, ~passing)[0])
        if count == 1 and len(whole) == len(mesh.faces):
            return buried
        chosen = _largest(mesh, whole, piece)
        inside = _inside(mesh.vertices[mesh.faces[whole[chosen]]], distance, _MIDDLE)[:, 0]
        buried[whole] = np.bincount(piece[chosen], ~inside, count)[piece] == 0.0
    buried[passing] = _inside(mesh.vertices[mesh.faces[passing]], distance, _PLACES).all(axis=1)
    return buried


def _cut_corners() -> FloatArray:
    """Return the corners of the pieces of a triangle cut in four again and again, barycentric, shape (4^n, 3, 3)."""
    pieces = np.eye(3)[None]
    for _ in range(_CUTS):
        a, b, c = pieces[:, 0], pieces[:, 1], pieces[:, 2]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        pieces = np.concatenate([np.stack(three, axis=1) for three in four])
    return pieces


def _largest(mesh: TriangleMesh, faces: NDArray[np.int64], piece: IntArray) -> NDArray[np.int64]:
    """Return places in `faces` of the largest of each piece."""
    corners = mesh.vertices[mesh.faces[faces]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    order = np.lexsort((-area, piece))
    first = np.searchsorted(piece[order], piece[order])  # where the piece of each begins
    return np.asarray(order[np.arange(len(order)) - first < _LOOKS])


def _inside(corners: FloatArray, distance: SurfaceDistance, weights: FloatArray) -> NDArray[np.bool_]:
    """Return whether places (barycentric, (W, 3)) just before triangles (N, 3, 3) are inside the body, shape (N, W)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    places = np.einsum("wk,nkd->nwd", weights, corners) + _BEFORE * normal[:, None]
    return distance.inside(places.reshape(-1, 3)).reshape(len(corners), len(weights))
