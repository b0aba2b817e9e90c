"""Clearance between cloth and body."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.signed_distance import SurfaceDistance, SurfacePoints
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def clearance(garment: TriangleMesh, body: TriangleMesh) -> SurfacePoints:
    """Return for each garment vertex its nearest body point; the distance [m] is negative inside the body.

    Args:
        garment: The draped garment [m].
        body: The body [m], oriented outward; small holes do no harm.
    """
    return SurfaceDistance(body).signed(garment.vertices)


def summarise_clearance(distance: FloatArray, areas: FloatArray, contact: float) -> dict[str, float]:
    """Return the clearance over the cloth's area [mm], how much of it touches, and how deep it enters the body.

    Args:
        distance: Signed distance of each vertex [m], shape (V,).
        areas: Area of each vertex [m²], shape (V,).
        contact: Distance below which cloth counts as touching [m].
    """
    median, p95 = np.quantile(distance, [0.5, 0.95], weights=areas, method="inverted_cdf")
    return {
        "min_mm": 1000 * float(distance.min()),
        "median_mm": 1000 * float(median),
        "p95_mm": 1000 * float(p95),
        "contact_mm": 1000 * contact,
        "contact_share": float(areas[distance < contact].sum() / areas.sum()),
        "inside_vertices": int((distance < 0.0).sum()),
    }
