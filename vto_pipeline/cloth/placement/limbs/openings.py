"""Through which openings of a garment the limbs of a body are to go, and through what they do go.

Every opening is there for a limb. So of all ways to send the limbs through the openings, with none left idle where
there are limbs enough, the nearest is taken. A line from a limb's end inward crosses that opening's lid where all is
well; where it meets cloth, an arm goes through a panel.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from vto_pipeline.cloth.placement.limbs.limbs import Limb, Limbs
from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.topology import boundary_loops, close_openings, face_components, submesh
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_MOST_OPENINGS = 7  # of a piece: more are slits and lace, and which limb is whose is anybody's guess
_PASSES = 0.1  # m: round an opening that a hand gets through
_BESIDE = 1e-9  # m: where a line meets a face is known to no better
_SPOKES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the way from the middle of a lid to its rim
_IDLE = 10.0  # m: as far as that may a limb be from an opening that had none


class Piece(NamedTuple):
    """A connected piece of a garment, and the limbs' ways through it.

    Args:
        mesh: Its triangles.
        vertices: Which vertices of the garment are its own, shape (P,).
        openings: Vertices of the piece around each opening, in order.
        meant: Index of the opening that each limb is to go through; -1 where that is open.
        through: Indices of the openings whose lids each limb crosses, on the whole; none where it ends inside.
        pierced: Where each limb meets cloth [m], shape (N, 3) each.
    """

    mesh: TriangleMesh
    vertices: IntArray
    openings: list[IntArray]
    meant: list[int]
    through: list[set[int]]
    pierced: list[FloatArray]

    def astray(self) -> list[int]:
        """Return the limbs that go through cloth, or not through the opening that is there for them alone."""
        alone = self.alone()
        return [
            limb
            for limb, (meant, through) in enumerate(zip(self.meant, self.through, strict=True))
            if len(self.pierced[limb]) > 0 or (limb in alone and len(through) > 0 and meant not in through)
        ]

    def misplaced(self) -> set[int]:
        """Return the limbs that are astray, or never come to the opening that is there for them alone."""
        idle = {limb for limb in self.alone() if self.meant[limb] not in self.through[limb]}
        return idle | set(self.astray())

    def alone(self) -> set[int]:
        """Return the limbs that have an opening to themselves."""
        return {limb for limb, opening in enumerate(self.meant) if opening >= 0 and self.meant.count(opening) == 1}

    def area_vector(self, opening: int) -> FloatArray:
        """Return the area that an opening encloses along each axis [m²], shape (3,), from the side that is up."""
        rim = self.mesh.vertices[self.openings[opening]]
        rim = rim - rim.mean(axis=0)
        area = 0.5 * np.cross(rim, np.roll(rim, -1, axis=0)).sum(axis=0)
        return np.asarray(area if area[1] >= 0.0 else -area)

    def steepness(self, opening: int, reach: float) -> float:
        """Return the mean sine of the slope of cloth about an opening, by area: 1 is upright, 0 level.

        What hangs from a waist is steep; what lies on shoulders goes outward first.

        Args:
            opening: Its index.
            reach: How far from it to look, over the cloth [m].
        """
        near = distance_from(self.mesh, self.openings[opening], reach) <= reach
        a, b, c = self.mesh.vertices[self.mesh.faces[near[self.mesh.faces].all(axis=1)]].transpose(1, 0, 2)
        double = np.cross(b - a, c - a)
        size = np.linalg.norm(double, axis=1).sum()
        return float(np.hypot(double[:, 0], double[:, 2]).sum() / size) if size > 0.0 else 0.0

    def missed(self, limb: int) -> str:
        """Return in words how far from its opening a limb goes through cloth; nothing where that is unknown."""
        if self.meant[limb] < 0:
            return ""
        loop = self.mesh.vertices[self.openings[self.meant[limb]]]
        far = cdist(self.pierced[limb], loop).min()
        return f", {1e3 * far:.0f} mm from the opening about ({', '.join(f'{x:.2f}' for x in loop.mean(axis=0))})"


def pieces_with_limbs(garment: TriangleMesh, limbs: Limbs, thin: TriangleMesh) -> list[Piece]:
    """Return the pieces of a garment with what the limbs do there.

    Args:
        garment: In its place about the body [m].
        limbs: Of the body.
        thin: The body as it is inside the garment, so thin that its limbs are lines [m].
    """
    count, piece = face_components(garment)
    ways = limbs.ways_in(thin)
    return [_piece(*submesh(garment, piece == number), limbs.limbs, ways) for number in range(count)]


def _piece(mesh: TriangleMesh, vertices: IntArray, limbs: Sequence[Limb], ways: Sequence[FloatArray]) -> Piece:
    """Return one piece, given as a mesh of its own and which vertices of the garment these are."""
    openings = boundary_loops(mesh)
    solid = close_openings(mesh)
    lid_of = np.repeat(np.arange(len(openings)), [len(loop) for loop in openings])
    through, pierced = [], []
    for way in ways:
        at, face = _crossings(way, solid)
        on_lid = face >= len(mesh.faces)
        pierced.append(at[~on_lid])
        crossed = np.bincount(lid_of[face[on_lid] - len(mesh.faces)], minlength=len(openings))
        through.append(set(np.flatnonzero(crossed % 2).tolist()))
    return Piece(mesh, vertices, openings, _nearest_ways(mesh, openings, limbs), through, pierced)


def _nearest_ways(mesh: TriangleMesh, openings: Sequence[IntArray], limbs: Sequence[Limb]) -> list[int]:
    """Return the opening that each limb is to go through: the nearest, with none left idle; -1 where unknown."""
    loops = [mesh.vertices[loop] for loop in openings]
    wide = [
        k for k, loop in enumerate(loops) if np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum() > _PASSES
    ]
    if not wide or len(wide) > _MOST_OPENINGS or not limbs:
        return [-1] * len(limbs)
    lids = [_lid(loops[k]) for k in wide]
    outside = [limb.axis[limb.along <= limb.joins] for limb in limbs]
    far = np.array([[cdist(line, lid).min() for lid in lids] for line in outside])
    ways = np.array(list(product(range(len(wide)), repeat=len(limbs))), np.int64)
    idle = len(wide) - np.array([(ways == k).any(axis=1) for k in range(len(wide))]).sum(axis=0)
    best = ways[int(np.argmin(far[range(len(limbs)), ways].sum(axis=1) + _IDLE * idle))]
    return [wide[k] for k in best]


def _lid(loop: FloatArray) -> FloatArray:
    """Return points all over the fan that closes an opening [m], shape (N, 3)."""
    middle = loop.mean(axis=0)
    return np.vstack([middle + share * (loop - middle) for share in _SPOKES])


def _crossings(line: FloatArray, mesh: TriangleMesh) -> tuple[FloatArray, IntArray]:
    """Return where a line of segments meets faces, in order along it [m], shape (N, 3), and which faces, shape (N,).

    Möller & Trumbore 1997, "Fast, minimum storage ray/triangle intersection", each segment with all triangles whose
    boxes meet its own.
    """
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    beside = _boxes_meet(low, high, line)
    corners, low, high = corners[beside], low[beside], high[beside]
    where, faces = [np.zeros((0, 3))], [np.zeros(0, np.int32)]
    for start, end in pairwise(line):
        near = _boxes_meet(low, high, np.stack([start, end]))
        if len(near) == 0:
            continue
        a, b, c = corners[near].transpose(1, 0, 2)
        one, two, way = b - a, c - a, end - start
        across = np.cross(way, two)
        size = np.einsum("fd,fd->f", one, across)
        size = np.where(np.abs(size) > 1e-30, size, np.inf)
        from_a = start - a
        u = np.einsum("fd,fd->f", from_a, across) / size
        other = np.cross(from_a, one)
        v, t = other @ way / size, np.einsum("fd,fd->f", two, other) / size
        hit = np.flatnonzero((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0) & (t < 1.0) & np.isfinite(size))
        hit = hit[np.argsort(t[hit], kind="stable")]
        where.append(start + t[hit, None] * way)
        faces.append(beside[near[hit]])
    return np.vstack(where), np.concatenate(faces)


def _boxes_meet(low: FloatArray, high: FloatArray, points: FloatArray) -> IntArray:
    """Return which boxes, from low to high, shapes (F, 3), meet the box about these points [m], shape (N, 3)."""
    first, last = points.min(axis=0) - _BESIDE, points.max(axis=0) + _BESIDE
    return np.flatnonzero(((low <= last) & (high >= first)).all(axis=1)).astype(np.int32)
