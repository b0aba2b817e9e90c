"""A run and its artifacts, made up, for the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.model.body import Measurements
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.garment import Opening, SurfaceLabels
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart


def tube(radius: float, low: float, high: float, around: int = 96, rings: int = 60) -> TriangleMesh:
    """An open tube about +Y, oriented outward."""
    angle = 2 * np.pi * np.arange(around) / around
    heights = np.linspace(low, high, rings)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    quads = np.stack([a, b, b + around, a, b + around, a + around], axis=-1)
    ring = np.stack([radius * np.sin(angle), 0 * angle, radius * np.cos(angle)], axis=1)
    return TriangleMesh((ring[None] + heights[:, None, None] * [0.0, 1.0, 0.0]).reshape(-1, 3), quads.reshape(-1, 3))


def stage(name: str, status: str = "ran", **more: Any) -> dict[str, Any]:
    """A stage's entry in run.json."""
    empty = {"reason": "", "metrics": {}, "notes": [], "warnings": [], "left_out": []}
    return {"name": name, "status": status, "seconds": 1.5, "peak_mb": 200.0, **empty, **more}


def run_record(*stages: dict[str, Any]) -> dict[str, Any]:
    """A run.json."""
    return {
        "schema": 1,
        "versions": {"numpy": "2.4.6"},
        "machine": {"cpu": "two cores"},
        "wanted": ["page"],
        "given": {"garment_mesh": {"key": "garment", "path": "shirt.ply"}},
        "seed": 0,
        "stages": list(stages)
        or [stage("drape", metrics={"error_mm": 0.41}, left_out=[["bending", "none in fabric"]])],
    }


def zone(name: str, verdict: str = "good") -> dict[str, Any]:
    """A zone of a fit report."""
    girths = {"body_girth_m": 0.94, "garment_girth_m": 1.0, "cloth_length_m": 1.01, "rest_length_m": 1.0}
    more = {"stretch": 0.01, "ease_m": 0.06, "allowance_m": [0.038, None], "source": "a book", "closed": True}
    return {"zone": name, **girths, **more, "verdict": verdict}


def all_parts() -> dict[str, Any]:
    """Every artifact the page knows."""
    garment, body = tube(0.18, 0.8, 1.5), tube(0.15, 0.0, 1.8)
    count = len(garment.vertices)
    striped = np.where((np.arange(count) // 96 % 8 < 4)[:, None], [200, 60, 60], [240, 240, 230]).astype(np.uint8)
    half = np.arange(count) % 2 == 0
    return {
        "render_mesh": (GlbPart("garment", TriangleMesh(garment.vertices, garment.faces, striped)),),
        "draped": garment,
        "garment": garment,
        "avatar": body,
        "garment_surface": garment,
        "labels": SurfaceLabels(half, np.ones(count)),
        "fit_maps": {"stretch": np.linspace(1, 1.2, count), "clearance_mm": np.linspace(0, 60, count)},
        "fit_report": {
            "verdict": "Chest good (+6.0 cm).",
            "zones": [zone("chest"), zone("waist")],
            "strain": {"median": 0.01, "p95": 0.03, "max": 0.2, "limit": 0.05, "share_over_limit": 0.02},
            "clearance": {
                "min_mm": 1.0,
                "median_mm": 20.0,
                "p95_mm": 40.0,
                "contact_mm": 3.0,
                "contact_share": 0.1,
                "inside_vertices": 0,
            },
            "note": "",
        },
        "trace": [TraceRow(0.1 * 2**k, 10 * k, 30 * 0.5**k, 0.1) for k in range(8)],
        "audit": {"finite": True, "body_intersections": 0, "penetration_mm": 0.0},
        "measurements": Measurements({"chest_girth": 0.96, "mass": 70.0}, {"chest_girth": 0.005}),
        "body_measurements": Measurements({"chest_girth": 0.95}),
        "openings": [
            Opening(np.arange(96, dtype=np.int32), 1.13, np.array([0.0, 1.5, 0.0]), np.array([0.0, 1.0, 0.0]))
        ],
    }
