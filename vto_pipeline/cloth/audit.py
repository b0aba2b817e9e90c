"""The judge after the fact, which shares nothing with the solver's collision.

Triangles are tested exactly (`geometry.intersections`), depths are libigl's distances and winding numbers.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh


def audit(
    mesh: TriangleMesh, rest: RestShape, body: TriangleMesh | None, *, settled: bool, energy: float, residual: float
) -> dict[str, object]:
    """Return what is wrong with a draped garment, as plain JSON values; nothing in it depends on run time.

    Args:
        mesh: The garment as draped [m].
        rest: Its rest shape.
        body: What it lies on, if anything.
        settled: Whether the drape came to rest.
        energy: Stored in the cloth [J].
        residual: Out-of-balance force, rms, as a share of a vertex's weight.

    Returns:
        finite, settled, body_intersections and self_intersections (pairs of triangles), penetration_mm (deepest
        vertex, 0 when none), min_clearance_mm, rms_stretch, max_stretch (of edges, relative), area_change, energy_j,
        residual.
    """
    finite = bool(np.isfinite(mesh.vertices).all())
    pairs = edges(mesh)
    length, natural = _lengths(mesh.vertices, pairs), _lengths(rest.positions, pairs)
    stretch = np.abs(length[natural > 0] / natural[natural > 0] - 1.0)
    return {
        "finite": finite,
        "settled": settled,
        **_against_body(mesh, body),
        "self_intersections": len(self_intersections(mesh)),
        "rms_stretch": float(np.sqrt(np.mean(stretch**2))),
        "max_stretch": float(stretch.max()),
        "area_change": float(_area(mesh.vertices, mesh) / _area(rest.positions, mesh) - 1.0),
        "energy_j": energy,
        "residual": residual,
    }


def _against_body(mesh: TriangleMesh, body: TriangleMesh | None) -> dict[str, object]:
    if body is None:
        return {"body_intersections": 0, "penetration_mm": 0.0, "min_clearance_mm": None}
    distance = SurfaceDistance(body).signed(mesh.vertices).distance
    return {
        "body_intersections": len(intersecting_faces(mesh, body)),
        "penetration_mm": float(1e3 * max(0.0, -distance.min())),
        "min_clearance_mm": float(1e3 * distance.min()),
    }


def _lengths(positions: FloatArray, pairs: np.ndarray) -> FloatArray:
    return np.linalg.norm(positions[pairs[:, 1]] - positions[pairs[:, 0]], axis=1)


def _area(positions: FloatArray, mesh: TriangleMesh) -> float:
    corners = positions[mesh.faces]
    double = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(0.5 * np.linalg.norm(double, axis=1).sum())
