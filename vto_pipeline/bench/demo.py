"""How far a run on the sample data is from the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_components
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

SAMPLES = 100_000
"""Points per surface; the 95th percentile of that many is known to about one in fifty."""


def measure_demo(run: Path, samples: Path) -> dict[str, Any]:
    """Hold a run's garment and drape against the sample data's truth.

    Args:
        run: A run of configs/demo.yaml, or of another config with the sample shirt.
        samples: The sample data's folder.

    Returns:
        {"garment": distances [mm] both ways, boundary loops and pieces, "draped": crossings, "stages": seconds}.
    """
    out = run / "out"
    found: dict[str, Any] = {}
    garment = read_own_mesh(out / "garment.ply")
    truth = read_own_mesh(samples / "truth" / "shirt.ply")
    found["garment"] = {
        "to_truth_mm": summarise(distances(garment, truth)),
        "from_truth_mm": summarise(distances(truth, garment)),
        "boundary_loops": len(boundary_loops(garment)),
        "boundary_loops_of_truth": len(boundary_loops(truth)),
        "pieces": face_components(garment)[0],
        "self_crossings": len(self_intersections(garment)),
    }
    if (out / "draped.ply").is_file():
        draped = read_own_mesh(out / "draped.ply")
        body = read_own_mesh(out / "avatar.ply")
        found["draped"] = {
            "vertices": len(draped.vertices),
            "finite": bool(np.isfinite(draped.vertices).all()),
            "body_crossings": len(intersecting_faces(draped, body)),
            "self_crossings": len(self_intersections(draped)),
        }
    record = read_json(run / "run.json")
    found["stages"] = {stage["name"]: stage["seconds"] for stage in record["stages"] if stage["status"] != "left_out"}
    return found


def distances(one: TriangleMesh, other: TriangleMesh) -> FloatArray:
    """Distance of points spread over one surface to the other [m], shape (SAMPLES,)."""
    points, _, _ = sample_surface(one, SAMPLES, seed=0)
    return SurfaceDistance(other).nearest(points).distance


def summarise(distance: FloatArray) -> dict[str, float]:
    """Median and tails [mm], and the shares within 1, 2 and 5 mm."""
    mm = 1000 * distance
    shares = {f"within_{limit}mm": round(float((mm <= limit).mean()), 4) for limit in (1, 2, 5)}
    return {
        "median": round(float(np.median(mm)), 3),
        "p95": round(float(np.percentile(mm, 95)), 3),
        "p99": round(float(np.percentile(mm, 99)), 3),
        **shares,
    }
