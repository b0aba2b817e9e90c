"""How much of a placed scan the mannequin reaches through: cloth is never inside it."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_normals, surface_area
from vto_pipeline.model.mesh import TriangleMesh

SPACING, MOST = 0.01, 50_000
"""Samples lie so far apart [m], and more are not taken."""
AROUND = 16
"""Samples over which a normal is averaged: what is within 2 cm."""
RUNS_ALONG = 0.7
"""Cosine between the averaged normal and the mannequin's above which a surface runs along it. Cloth has 0.95, and what
stereo guesses of white limbs a third: it stands any way."""


def inside_share(placed: TriangleMesh, mannequin: TriangleMesh, deeper: float, seed: int) -> float:
    """Return the share of a scan that lies inside the mannequin and runs along it.

    A mannequin that is wrong, or in a wrong place, reaches through cloth, which is smooth. Depth that stereo guesses on
    bare limbs without texture lies on both sides of them. It says nothing of the placement, and is rough: the normals
    of a few centimetres cancel.

    Args:
        placed: The scan in the mannequin's frame [m].
        mannequin: What it was on.
        deeper: What is less deep is not counted [m].
        seed: Of the samples.
    """
    count = int(np.clip(surface_area(placed) / SPACING**2, AROUND, MOST))
    points, normals, _ = sample_surface(placed, count, seed)
    even = normals[cKDTree(points).query(points, k=AROUND)[1]].mean(axis=1)
    near = SurfaceDistance(mannequin).signed(points)
    along = np.einsum("nd,nd->n", even, face_normals(mannequin)[near.face])
    return float(np.mean((near.distance < -deeper) & (along > RUNS_ALONG)))
