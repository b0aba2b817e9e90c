"""The form's colours at the rims of a garment, where a cut took some of the form with the cloth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.topology import edge_face_counts
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.texture.views import Samples

REACH = 0.012
"""How far from a rim the form's colour is looked for [m]; a cut is off by less."""

LIKE_FORM = 0.5
"""A colour is the form's where that is nearer than this share of the distance to the cloth's colours."""

UNLIKE_CLOTH = 10.0
"""And where it is at least so far from all of the cloth's [of 255]: a print that has the form's colour keeps it."""

COLORS = 20_000
"""At most so many of each are compared with."""


def form_at_rims(
    mesh: TriangleMesh, samples: Samples, colors: NDArray[np.float32], known: NDArray[np.bool_], form: NDArray[np.uint8]
) -> NDArray[np.bool_]:
    """Return which samples near a rim show the form, by their colour, shape (N,).

    Args:
        mesh: The garment [m].
        samples: Points on it, N of them.
        colors: Theirs, 0 to 255, shape (N, 3).
        known: Which of them a photo shows, shape (N,).
        form: Colours of the bare form, shape (B, 3).
    """
    near = known & _near_rims(mesh, samples)
    cloth = colors[known & ~near]
    found = np.zeros(len(known), dtype=bool)
    if not near.any() or not len(cloth) or not len(form):
        return found
    own, other = (_distance(some, colors[near]) for some in (cloth, form.astype(np.float64)))
    found[near] = (own > UNLIKE_CLOTH) & (other < LIKE_FORM * own)
    return found


def _near_rims(mesh: TriangleMesh, samples: Samples) -> NDArray[np.bool_]:
    edges, count = edge_face_counts(mesh)
    ends = mesh.vertices[edges[count == 1]]
    if not len(ends):
        return np.zeros(len(samples.face), dtype=bool)
    share = np.linspace(0.0, 1.0, 5)[:, None, None]
    rims = cKDTree(((1.0 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, 3))
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    away = rims.query(mesh.vertices)[0][mesh.faces].min(axis=1)
    asked = np.flatnonzero((away - longest < REACH)[samples.face])
    points = np.einsum("nk,nkd->nd", samples.weight[asked], corners[samples.face[asked]])
    near = np.zeros(len(samples.face), dtype=bool)
    near[asked] = rims.query(points, distance_upper_bound=REACH)[0] < REACH
    return near


def _distance(some: FloatArray | NDArray[np.float32], colors: NDArray[np.float32]) -> FloatArray:
    """Return how far each colour is from the nearest of some, shape (N,)."""
    step = max(1, len(some) // COLORS)
    return np.asarray(cKDTree(some[::step]).query(colors)[0])
