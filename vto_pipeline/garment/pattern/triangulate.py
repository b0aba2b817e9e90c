"""Panels in triangles of one size, their outlines sampled as given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.pattern.sampling import Samples
from vto_pipeline.garment.simulation_mesh import least_angles
from vto_pipeline.geometry.remeshing.refine import refine
from vto_pipeline.io.patterns.loops import edges_area, edges_points
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Panel
from vto_pipeline.numerics.plane_curves import at_shares

_AREA = 1e-6  # of a panel: triangles that cover more or less than the outline encloses, overlap
_FLAT_M = 1e-4


@dataclass(frozen=True)
class FlatPanel:
    """A panel in triangles.

    Args:
        name: Of the panel.
        points: In the plane [m]; those of the outline first, in order, shape (V, 2).
        faces: Anticlockwise, shape (F, 3).
        first: Number of the first sample of each edge, shape (E,).
        outline: How many points the outline has.
        angles: The smallest of each triangle [rad], shape (F,).
    """

    name: str
    points: FloatArray
    faces: IntArray
    first: IntArray
    outline: int
    angles: FloatArray

    def vertex(self, edge: int, sample: int) -> int:
        """Return the point that is a sample of an edge; an edge's last is the next one's first."""
        return (int(self.first[edge]) + sample) % self.outline


def triangulate_panel(panel: Panel, samples: Samples, edge: float) -> FlatPanel:
    """Return a panel in triangles of about one edge length.

    Args:
        panel: With its cut-outs, which stay open.
        samples: Of its edges.
        edge: Target edge length [m].

    Raises:
        GarmentError: the outline crosses itself, or a cut-out leaves it.
    """
    from manifold3d import triangulate

    shares = [samples.shares[panel.name, k] for k in range(len(panel.edges))]
    parts = [at_shares(e.kind, e.points, e.bulge, s)[:-1] for e, s in zip(panel.edges, shares, strict=True)]
    first = np.cumsum([0, *(len(part) for part in parts)])[:-1]
    loops = [np.concatenate(parts)]
    for line in panel.lines:
        if line.kind == "cutout" and (line.curves[0].points[0] == line.curves[-1].points[-1]).all():
            hole = _evenly(edges_points(line.curves, _FLAT_M), edge)
            loops.append(hole if edges_area(line.curves) < 0.0 else hole[::-1])
    points = np.concatenate(loops)
    faces = np.asarray(triangulate(loops, allow_convex=False), dtype=np.int32)
    areas = _areas(points, faces)
    wanted = sum(_loop_area(loop) for loop in loops)
    if len(faces) == 0 or abs(np.abs(areas).sum() - wanted) > _AREA * abs(wanted):
        problem = f"panel {panel.name!r}: the outline crosses itself at edges of {1e3 * edge:g} mm"
        raise GarmentError(problem, hint="or a cut-out leaves the outline; look at it with vto pattern -o FILE.svg")
    flat = TriangleMesh(np.concatenate([points, np.zeros((len(points), 1))], axis=1), faces)
    fine = refine(flat, edge, np.zeros((len(points), len(points)), np.bool_))
    outline = len(loops[0])
    angles = least_angles(fine.vertices[fine.faces])
    return FlatPanel(panel.name, fine.vertices[:, :2], fine.faces, first.astype(np.int32), outline, angles)


def _evenly(points: FloatArray, edge: float) -> FloatArray:
    """Return a closed polyline sampled about one edge length apart, its end left out."""
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    shares = np.linspace(0.0, 1.0, max(3, round(length / edge)) + 1)
    return at_shares("polyline", points, 0.0, shares)[:-1]


def _areas(points: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


def _loop_area(points: FloatArray) -> float:
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
