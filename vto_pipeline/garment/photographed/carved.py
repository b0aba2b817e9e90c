"""Fillings cut back to where no photo shows the background through them.

A filling under an arm spans the armpit as a web. Stereo finds nothing there, but photos that look through beneath the
arm show the background where the web would hide it: the cloth is farther in (visual hull; Laurentini 1994).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.photographed.backdrop import Backdrop, far_beyond, find_backdrops
from vto_pipeline.garment.photographed.confirmed import moved_uncrossed
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

LEAST_VIEWS = 2
"""Photos that must show the background."""
EVEN = 0.015
"""Normals are evened out over this length, so that ways inwards do not meet in a crease [m]."""
BESIDE_RIM = 0.015
"""Nearer to an opening it may be the mannequin or the cloth's inside that photos show beside a filling [m]."""
STEP, REACH = 0.0005, 0.04
"""Ways inwards are tried by so much more each time, and no longer ones [m]."""


def carve_fillings(
    mesh: TriangleMesh,
    observed: NDArray[np.bool_],
    mannequin: TriangleMesh,
    photos: PosedPhotos,
    distance: SurfaceDistance,
    least: float,
    job: Job,
) -> TriangleMesh:
    """Move what was filled inwards to where photos no longer show background through it.

    Nothing comes nearer to the mannequin than it may, or than it was, and nothing crosses what it did not. Openings
    stay as they are, and what is beside them follows. A place is only bounded by this, not found: nothing counts as
    observed.

    Args:
        mesh: A garment with an opening at least, its holes filled.
        observed: Which of its vertices a sensor saw, shape (V,): they stay.
        mannequin: In the same frame.
        photos: With their cameras in that frame.
        distance: Signed distances to the mannequin [m].
        least: Nothing that was filled may be nearer to it [m].
        job: Receives how many photos told, how many vertices were moved, and how far; or that it was left out.
    """
    backdrops = find_backdrops(mesh, observed, mannequin, photos)
    if len(backdrops) < LEAST_VIEWS:
        job.leave_out("fillings cut back", "no photos tell the background behind fillings from cloth by colour")
        return mesh
    inwards = -_evened_normals(mesh)
    rims = np.concatenate(boundary_loops(mesh))
    held, apart = observed.copy(), ~observed
    held[rims] = True
    apart[~observed] = cKDTree(mesh.vertices[rims]).query(mesh.vertices[~observed])[0] > BESIDE_RIM
    way, tried = np.zeros_like(mesh.vertices), np.flatnonzero(apart)
    far = _far_inwards(mesh.vertices[tried], inwards[tried], backdrops)
    way[tried] = far[:, None] * inwards[tried]
    moved, went = moved_uncrossed(mesh, way, held, apart, distance, least)
    gone = far[went[tried] & (far > 0.0)]
    job.measure(
        carving_photos=len(backdrops),
        carved_vertices=len(gone),
        carved_p95_mm=round(1e3 * float(np.percentile(gone, 95)), 2) if len(gone) else 0.0,
    )
    return moved


def _evened_normals(mesh: TriangleMesh) -> FloatArray:
    """Normals of the vertices (V, 3) after diffusing over the surface for one implicit step."""
    matrix, area = laplacian(mesh)
    even = splu((diags(area) + EVEN**2 * matrix).tocsc()).solve(area[:, None] * vertex_normals(mesh))
    return np.asarray(even / np.maximum(np.linalg.norm(even, axis=1, keepdims=True), 1e-12))


def _far_inwards(points: FloatArray, inwards: FloatArray, backdrops: Sequence[Backdrop]) -> FloatArray:
    """Return how far each point must go until no background shows through it [m], (N,); 0 where it never ends."""
    far = np.zeros(len(points))
    left = np.flatnonzero(far_beyond(points, backdrops) > STEP)
    for number in range(1, int(REACH / STEP) + 1):
        if len(left) == 0:
            break
        ends = far_beyond(points[left] + number * STEP * inwards[left], backdrops) <= 0.0
        far[left[ends]] = number * STEP
        left = left[~ends]
    return far
