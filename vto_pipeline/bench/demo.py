"""Errors of a run on the sample data against the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.avatar.measure import measure
from vto_pipeline.cloth.judge.crossings import crossings_between, self_crossings
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_components
from vto_pipeline.io.bodies.avatars import read_avatar
from vto_pipeline.io.bodies.measurements import read_measurements
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

SAMPLES = 100_000
"""Points per surface; the 95th percentile of that many is known to about one in fifty."""


JUDGED = ("settled", "residual", "judged_residual", "rms_stretch", "max_stretch")
"""What is taken from audit.json as it stands."""

TAPES = {"bust_girth": "chest_girth", "waist_girth": "waist_girth", "hip_girth": "hip_girth"}
"""The truth's tapes, and what the avatar calls them."""

_CORE = (0.10, 0.80, 0.27)
"""Trunk and limbs: heights as shares of the stature, and how far from the middle [m]. Not feet, head or hands."""


def measure_demo(run: Path, samples: Path) -> dict[str, Any]:
    """Hold a run's garment, drape and body against the sample data's truth.

    Args:
        run: A run of one of the sample configs.
        samples: The sample data's folder.

    Returns:
        {"garment": distances [mm] both ways, boundary loops and pieces, "draped": crossings and what the judge found,
        "body": girths off the truth [mm] and distances of trunk and limbs [mm], "stages": seconds}, of what there is.
    """
    out, truth = run / "out", samples / "truth"
    found: dict[str, Any] = {}
    if (out / "garment.ply").is_file():
        found["garment"] = _garment(read_own_mesh(out / "garment.ply"), read_own_mesh(truth / "shirt.ply"))
    if (out / "draped.ply").is_file():
        found["draped"] = _draped(out)
    if (out / "avatar.npz").is_file():
        found["body"] = _body(out, truth)
    record = read_json(run / "run.json")
    found["stages"] = {stage["name"]: stage["seconds"] for stage in record["stages"] if stage["status"] != "left_out"}
    return found


def _garment(garment: TriangleMesh, truth: TriangleMesh) -> dict[str, Any]:
    return {
        "to_truth_mm": summarise(distances(garment, truth)),
        "from_truth_mm": summarise(distances(truth, garment)),
        "boundary_loops": len(boundary_loops(garment)),
        "boundary_loops_of_truth": len(boundary_loops(truth)),
        "pieces": face_components(garment)[0],
        "self_crossings": len(self_crossings(garment)),
    }


def _draped(out: Path) -> dict[str, Any]:
    draped, body = read_own_mesh(out / "draped.ply"), read_own_mesh(out / "avatar.ply")
    judged = read_json(out / "audit.json")
    return {
        "vertices": len(draped.vertices),
        "finite": bool(np.isfinite(draped.vertices).all()),
        "body_crossings": len(crossings_between(draped, body)),
        "self_crossings": len(self_crossings(draped)),
        **{name: judged[name] for name in JUDGED if name in judged},
    }


def _body(out: Path, truth: Path) -> dict[str, Any]:
    avatar, customer = read_avatar(out / "avatar.npz"), read_own_mesh(truth / "customer_body.ply")
    read, known = measure(avatar).values, read_measurements(truth / "customer_measurements.json").values
    points, _, _ = sample_surface(customer, SAMPLES, seed=0)
    low, high, aside = _CORE[0] * known["stature"], _CORE[1] * known["stature"], _CORE[2]
    core = (points[:, 1] > low) & (points[:, 1] < high) & (np.abs(points[:, 0]) < aside)
    away = SurfaceDistance(avatar.mesh).nearest(points[core]).distance
    return {
        "girths_off_mm": {name: round(1e3 * (read[ours] - known[name]), 1) for name, ours in TAPES.items()},
        "core_mm": {"mean": round(1e3 * float(away.mean()), 3), **summarise(away)},
    }


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
