"""Which pieces of what was taken for cloth are worn, and how much cloth the others are.

A jacket and trousers are two pieces, and so is a garment whose middle was not seen. Beside them lie scraps: noise on
bare limbs, furniture. A piece is worn that is large beside the others, comes near the mannequin, and has it pass
through. What is not, but hangs near, is cloth of which nothing was seen that holds it: it counts as not seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.geometry.apart import APART
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, component_areas, face_areas, face_components, submesh
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

LEAST = 0.05
"""A piece of a smaller share of the largest one's area is no garment: a sock beside trousers has as much, and noise on
a bare limb less than half."""
CRUMB = 0.01
"""Smaller pieces that cleaning leaves are dropped without a word."""
LARGE = 0.1
"""With a larger share lost the garment was torn, which is warned of; less is noted."""
OVER = 0.02
"""A filling this near to lost cloth stands for it, and counts as not seen already [m]."""
BARE = 0.2
"""Where a larger share of the gap between two pieces was seen bare, they are two garments."""


def large_faces(mesh: TriangleMesh, whole: IntArray) -> NDArray[np.bool_]:
    """Return which faces belong to large parts of what they were cut from, beside its largest, shape (F,).

    Args:
        mesh: In parts.
        whole: From which piece each face comes, shape (F,).
    """
    part, area = component_areas(mesh)
    largest = np.zeros(int(whole.max()) + 1)
    np.maximum.at(largest, whole, area[part])
    return np.asarray(area[part] >= LEAST * largest[whole])


def without_crumbs(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh without its smallest pieces."""
    piece, area = component_areas(mesh)
    return submesh(mesh, (area >= CRUMB * area.max())[piece])[0]


def split_off(mesh: TriangleMesh, keep: NDArray[np.bool_]) -> tuple[TriangleMesh, list[TriangleMesh]]:
    """Return the kept faces (F,) of a mesh, and the others, none or one mesh; what keeps all is returned as it is."""
    if keep.all():
        return mesh, []
    return submesh(mesh, keep)[0], [submesh(mesh, ~keep)[0]]


def may_be_worn(shell: TriangleMesh, distance: SurfaceDistance | None) -> NDArray[np.bool_]:
    """Return which faces belong to large pieces that come near the mannequin somewhere, shape (F,).

    Args:
        shell: What was taken for cloth, in pieces [m].
        distance: To the mannequin; None where there is none, and size alone tells.
    """
    piece, area = component_areas(shell)
    near = np.ones(len(area), dtype=bool)
    if distance is not None and len(area) > 1:
        away = _nearest(shell, piece, len(area), distance.nearest(shell.vertices).distance)
        near = away <= max(APART, float(away.min()))
    return np.asarray((near & (area >= LEAST * area[near].max()))[piece])


def lost_cloth(
    rest: Sequence[TriangleMesh],
    garment: TriangleMesh,
    observed: NDArray[np.bool_],
    distance: SurfaceDistance | None,
    job: Job,
) -> float:
    """Return the area of cloth that was seen but hangs on nothing that was [m²]; what is far off is none.

    Args:
        rest: What was taken for cloth and is not worn.
        garment: As found.
        observed: Which of its vertices were seen, shape (V,).
        distance: To the mannequin; None where there is none, and all is taken for cloth.
        job: Receives the area and the place of the largest piece: a warning where it is much beside the garment.
    """
    tree, lost, most = cKDTree(garment.vertices), 0.0, (0.0, np.zeros(3))
    for mesh in rest:
        count, piece = face_components(mesh)
        away, beside = tree.query(mesh.vertices)
        stood_for = (away < OVER) & ~observed[beside]
        least = np.zeros_like(away)
        if distance is not None:
            least = np.minimum(away, distance.nearest(mesh.vertices).distance)
        counts = (_nearest(mesh, piece, count, least) <= APART)[piece] & ~stood_for[mesh.faces].any(axis=1)
        area = np.bincount(piece, face_areas(mesh) * counts, count)
        lost += float(area.sum())
        if area.max() > most[0]:
            most = float(area.max()), mesh.vertices[mesh.faces[piece == int(np.argmax(area))]].mean(axis=(0, 1))
    if lost > 0.0:
        share = lost / (lost + float(face_areas(garment).sum()))
        x, y, z = most[1]
        what = (
            f"{1e4 * lost:.0f} cm² of cloth, {share:.0%} of the garment, hang on nothing that was seen and are left out"
        )
        (job.warn if share > LARGE else job.note)(f"{what}; the largest piece is at ({x:.2f}, {y:.2f}, {z:.2f}) m")
    job.measure(lost_cm2=round(1e4 * lost, 1))
    return lost


def warn_of_torn(garment: TriangleMesh, bare: BareParts, job: Job) -> None:
    """Warn where two pieces end beside each other and the mannequin between them was not seen bare.

    Between a top and trousers it was. Where it was not, it may be one garment that was torn, as a sleeve that came off.

    Args:
        garment: The finished garment.
        bare: What was seen of the bare mannequin.
        job: Receives the warnings.
    """
    count, piece = face_components(garment)
    of_vertex = np.zeros(len(garment.vertices), dtype=np.int32)
    of_vertex[garment.faces] = piece[:, None]
    loops = boundary_loops(garment)
    for one in range(count) if loops else ():
        rim = np.concatenate(loops)
        mine, others = rim[of_vertex[rim] == one], rim[of_vertex[rim] < one]  # each pair once
        if len(mine) == 0 or len(others) == 0:
            continue
        gap, across = cKDTree(garment.vertices[others]).query(garment.vertices[mine], distance_upper_bound=APART)
        facing = np.isfinite(gap)
        if not facing.any():
            continue
        start, end = garment.vertices[mine[facing]], garment.vertices[others[across[facing]]]
        between = np.concatenate([start + share * (end - start) for share in (0.25, 0.5, 0.75)])
        if float(np.mean(bare.under(between))) > BARE:
            continue
        x, y, z = between[len(between) // 2]
        job.warn(
            f"two pieces end {1e3 * float(np.median(gap[facing])):.0f} mm apart near ({x:.2f}, {y:.2f}, {z:.2f}) m, "
            "and nothing was seen between them. If they are one garment, take more photos of that place"
        )


def _nearest(mesh: TriangleMesh, piece: IntArray, count: int, away: FloatArray) -> FloatArray:
    """Return the least distance of each piece, shape (P,), from those of the vertices, shape (V,) [m]."""
    least = np.full(count, np.inf)
    np.minimum.at(least, piece, away[mesh.faces].min(axis=1))
    return least
