"""A scanned garment beside the true one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.demo import SAMPLES, distances, summarise
from vto_pipeline.garment.loop_evidence import measure_loops
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.similarity import fit_similarity

_ROUNDS = 60
_KEPT = 0.9
"""Share of the points, the nearest, that the scale is read off: fillings and stray parts have no say."""


def beside_truth(garment: TriangleMesh, truth: TriangleMesh) -> dict[str, Value]:
    """Return distances both ways [mm], the share of the truth within 2 mm, openings of both, by how much the length of
    one is off at worst, and the scale's error.

    Args:
        garment: As scanned, in the frame of the truth.
        truth: Open shell.
    """
    there, back = summarise(distances(garment, truth)), summarise(distances(truth, garment))
    return {
        **{f"{name}_mm": there[name] for name in ("median", "p95", "p99")},
        **{f"back_{name}_mm": back[name] for name in ("median", "p95", "p99")},
        "complete_2mm": back["within_2mm"],
        "openings": len(boundary_loops(garment)),
        "true_openings": len(boundary_loops(truth)),
        "rim_off_percent": rims_off(garment, truth),
        "scale_off_percent": 100.0 * (scale_of(garment, truth) - 1.0),
    }


def rims_off(garment: TriangleMesh, truth: TriangleMesh) -> float | None:
    """Return how much longer or shorter an opening is than the true one nearest to it, at worst [%].

    None where one of the two is closed.
    """
    found, true = measure_loops(garment), measure_loops(truth)
    if not found or not true:
        return None
    places = np.array([one.center for one in true])
    nearest = [true[int(np.argmin(np.linalg.norm(places - one.center, axis=1)))] for one in found]
    off = [100.0 * (one.perimeter / its.perimeter - 1.0) for one, its in zip(found, nearest, strict=True)]
    return max(off, key=abs)


def cameras_off(cameras: CameraSet, true_places: Mapping[str, FloatArray]) -> float | None:
    """Return the median distance of photos from where they were taken [mm], once all were brought there as one.

    Args:
        cameras: As scanned, in any frame and unit.
        true_places: Name of a photo -> its camera's centre [m], shape (3,).

    Returns:
        None with fewer than three photos whose place is known.
    """
    known = [index for index, name in enumerate(cameras.names) if name in true_places]
    if len(known) < 3:
        return None
    places = cameras.world_from_cam[known, :3, 3]
    truth = np.array([true_places[cameras.names[index]] for index in known])
    scale, motion = fit_similarity(places, truth)
    off = scale * places @ motion[:3, :3].T + motion[:3, 3] - truth
    return 1e3 * float(np.median(np.linalg.norm(off, axis=1)))


def scale_of(garment: TriangleMesh, truth: TriangleMesh) -> float:
    """Return how many times too large the garment is: the similarity that brings it onto the truth, inverted.

    Iterated closest points, trimmed (Besl and McKay 1992; Chetverikov et al. 2005), from where the garment lies.
    """
    points, _, _ = sample_surface(garment, SAMPLES // 5, seed=0)
    surface = SurfaceDistance(truth)
    moved, total = points, 1.0
    for _ in range(_ROUNDS):
        near = surface.nearest(moved)
        kept = near.distance <= np.quantile(near.distance, _KEPT)
        scale, motion = fit_similarity(moved[kept], near.point[kept])
        moved = scale * moved @ motion[:3, :3].T + motion[:3, 3]
        total *= scale
    return 1.0 / total
