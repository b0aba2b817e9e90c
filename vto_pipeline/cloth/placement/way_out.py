"""Where cloth inside a body wants to go: out, through the part of it that looks the same way.

Cloth in a limb does not know from its depth which side it belongs to: beyond the axis the nearest way out is the wrong
one, and a sleeve would be pinched through the arm. Its own outer face knows: cloth comes out where the body looks as it
does itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import close_openings, face_normals, vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_TURNED = 0.1  # m: how much longer a way may be for two unit normals that differ by one


class Wanted(NamedTuple):
    """The moves that cloth inside a body asks for.

    Args:
        buried: Vertices that are inside, shape (N,).
        way: Directions in which they are to go, unit, shape (N, 3).
        depth: How far [m], shape (N,).
    """

    buried: IntArray
    way: FloatArray
    depth: FloatArray


class WayOut:
    """A garment's ways out of a body.

    Args:
        body: Oriented outward [m].
        garment: Oriented throughout, outward or inward [m].
    """

    def __init__(self, body: TriangleMesh, garment: TriangleMesh) -> None:
        self._looks, self._middles = face_normals(body), body.vertices[body.faces].mean(axis=1)
        self._by_place_and_look = cKDTree(np.hstack([self._middles, _TURNED * self._looks]))
        self._surface = SurfaceDistance(body)
        self._outward, self._faces = _outward(garment), garment.faces

    def wanted(self, positions: FloatArray) -> Wanted:
        """Return what cloth asks for whose vertices are here [m], shape (V, 3)."""
        buried = np.flatnonzero(self._surface.inside(positions)).astype(np.int32)
        own = self._outward * vertex_normals(TriangleMesh(positions, self._faces))[buried]
        _, face = self._by_place_and_look.query(np.hstack([positions[buried], _TURNED * own]))
        depth = np.einsum("vi,vi->v", self._middles[face] - positions[buried], self._looks[face])
        return Wanted(buried, self._looks[face], np.maximum(depth, 0.0))


def _outward(garment: TriangleMesh) -> float:
    """Return 1 where the garment's faces look outward, its openings closed, and -1 where they look inward."""
    solid = close_openings(garment)
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    return float(np.sign(np.einsum("fi,fi->", a, np.cross(b, c))))
