"""Evidence whether a boundary loop is an opening of the garment or a hole in the scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_walks, face_normals, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

DEEP, LEAST_FILLED = 0.2, 0.1
"""A body part goes through a loop when it is this share of the loop's radius deep, and fills this share of the disc."""
OUTSIDE, INSIDE = 0.15, 0.5
"""It is as deep so many radii before the loop and behind it: what bulges into a hole, or slants across, ends there."""
RIM_OUTSIDE = 0.9
"""Share of the rim that must stay outside the mannequin while the disc is moved inwards."""
BEYOND, GOES_ON = 1.1, 0.1
"""In the plane of a loop that goes round a part of the mannequin, that does not reach so many radii out, but for this
share of the way round."""
RINGS = np.arange(0.5, 6.0) / 6.0
AROUND = 36
"""A loop is looked at in so many places, evenly along it."""


@dataclass(frozen=True)
class LoopShape:
    """Measurements of a boundary loop.

    Args:
        walk: Boundary half-edges in order, shape (L,).
        loop: The vertices where they start, shape (L,).
        perimeter: [m].
        center: Of the curve [m], shape (3,).
        normal: Of the disc that would close it, out of the garment, unit, shape (3,).
        tubular: How much the surface runs across that disc: 1 at the end of a tube, 0 at a hole in a sheet.
    """

    walk: IntArray
    loop: IntArray
    perimeter: float
    center: FloatArray
    normal: FloatArray
    tubular: float


def measure_loops(mesh: TriangleMesh) -> list[LoopShape]:
    """Measure each boundary loop of a garment."""
    start, normals = half_edges(mesh)[:, 0], face_normals(mesh)
    return [_measure(mesh, walk, start[walk], normals[walk // 3]) for walk in boundary_walks(mesh)]


def _measure(mesh: TriangleMesh, walk: IntArray, loop: IntArray, beside: FloatArray) -> LoopShape:
    """Measure one loop; beside: the normals of its faces, shape (L, 3)."""
    length, center, normal = _disc(mesh.vertices[loop])
    tubular = 1.0 - float(np.average(np.abs(beside @ normal), weights=length))
    return LoopShape(walk, loop, float(length.sum()), center, normal, tubular)


def _disc(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the lengths of a loop's edges (L,), its centre, and the unit normal of its disc, out of the garment."""
    after = np.roll(points, -1, axis=0)
    length = np.linalg.norm(after - points, axis=1)
    center = ((points + after) * length[:, None]).sum(axis=0) / (2.0 * length.sum())
    (a, b, c), (d, e, f) = (points - center).T, (after - center).T  # np.cross takes longer than all the rest
    area = -0.5 * np.array([b @ f - c @ e, c @ d - a @ f, a @ e - b @ d])  # a filling runs against the boundary
    return length, center, area / max(float(np.linalg.norm(area)), 1e-12)


def encloses(points: FloatArray, distance: SurfaceDistance, reach: float) -> bool:
    """Return whether the mannequin passes through a loop, or ends not far inside it.

    A body part that ends inside is found when the disc that spans the loop is moved into the garment by up to `reach`,
    and the rim stays outside of it. Before a hole in a sheet over the body, middle and rim go inside together.

    Args:
        points: The loop in order, running as a boundary does [m], shape (L, 3).
        distance: Signed distances to the mannequin.
        reach: How far inside the body part may end [m].
    """
    loop = _Loop(points)
    if loop.is_passed_through(distance):
        return True
    for shift in np.linspace(0.0, reach, 7)[1:]:
        inward = -shift * loop.normal
        if loop.outside_share(inward, distance) < RIM_OUTSIDE:
            return False
        if loop.is_filled(inward, distance):
            return True
    return False


def goes_round(points: FloatArray, distance: SurfaceDistance) -> bool:
    """Return whether a loop goes round a part of the mannequin: in its plane nothing of it lies beyond.

    The rim of a sheet that lies over half of a limb encloses some of it, too, but the limb goes on under the sheet's
    ends.

    Args:
        points: The loop in order [m], shape (L, 3).
        distance: Signed distances to the mannequin.
    """
    loop = _Loop(points)
    middle = loop.points.mean(axis=0)
    out = BEYOND * (loop.points - middle)
    in_plane = middle + out - (out @ loop.normal)[:, None] * loop.normal
    return float(np.mean(distance.inside(in_plane))) < GOES_ON


def outside_share(points: FloatArray, distance: SurfaceDistance) -> float:
    """Return which share of a loop (L, 3) lies outside the mannequin, or hardly inside."""
    return _Loop(points).outside_share(np.zeros(3), distance)


def disc_of(points: FloatArray) -> FloatArray:
    """Return points of the disc that spans a loop (L, 3), evenly along its radii, shape (N, 3)."""
    return _Loop(points).disc


def is_filled(points: FloatArray, distance: SurfaceDistance) -> bool:
    """Return whether the mannequin fills the middle of a loop (L, 3): it need not go on beyond."""
    return _Loop(points).is_filled(np.zeros(3), distance)


def passes_through(points: FloatArray, distance: SurfaceDistance) -> bool:
    """Return whether a part of the mannequin fills the middle of a loop and goes on on both sides of it.

    What lies inside of the loop itself does not count: the rim is cloth, and was bridged there.

    Args:
        points: The loop in order [m], shape (L, 3).
        distance: Signed distances to the mannequin.
    """
    return _Loop(points).is_passed_through(distance)


class _Loop:
    """A loop (L, 3) as points at even distances along it, and the disc that spans it."""

    def __init__(self, points: FloatArray) -> None:
        self.points = _evenly(points)
        length, center, self.normal = _disc(self.points)
        self.radius = float(length.sum()) / (2.0 * np.pi)
        self.disc = (center + RINGS[:, None, None] * (self.points - center)).reshape(-1, 3)

    def outside_share(self, shift: FloatArray, distance: SurfaceDistance) -> float:
        """Return which share of the moved loop lies outside the mannequin, or hardly inside."""
        return float(np.mean(distance.signed(self.points + shift).distance > -0.05 * self.radius))

    def is_passed_through(self, distance: SurfaceDistance) -> bool:
        """Return whether the mannequin fills the disc, and goes on on both sides of it."""
        outward = self.radius * self.normal
        return all(self.is_filled(share * outward, distance) for share in (0.0, OUTSIDE, -INSIDE))

    def is_filled(self, shift: FloatArray, distance: SurfaceDistance) -> bool:
        """Return whether the mannequin fills the middle of the disc, when that is moved."""
        inside = distance.inside(self.disc + shift)
        if np.average(inside, weights=np.repeat(RINGS, AROUND)) <= LEAST_FILLED:
            return False
        return bool(distance.nearest((self.disc + shift)[inside]).distance.max() > DEEP * self.radius)


def _evenly(points: FloatArray) -> FloatArray:
    """Return a closed curve (L, 3) as points at even distances along it, shape (AROUND, 3)."""
    closed = np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(AROUND) / AROUND * along[-1]
    return np.column_stack([np.interp(at, along, closed[:, d]) for d in range(3)])
