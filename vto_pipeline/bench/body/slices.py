"""An independent tape: the convex hull of a plane section of any mesh, by trimesh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from vto_pipeline.errors import InputError
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

TRUNK = ("chest", "underbust", "waist", "navel", "hip")
"""Girths that are taken on the trunk."""


def slice_girth(mesh: TriangleMesh, height: float, *, armless: bool = False) -> float:
    """Return the taut girth [m] of the section's loop nearest to the body's axis; arms held off are other loops.

    Args:
        mesh: A body that stands along y.
        height: Of the section [m].
        armless: Whether the mesh is a trunk, open where arms were: then all of the section counts.

    Raises:
        InputError: the plane misses the body.
    """
    import trimesh

    middle = np.median(mesh.vertices[:, [0, 2]], axis=0)
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    section = whole.section([0.0, 1.0, 0.0], [0.0, height, 0.0])
    if section is None:
        raise InputError(f"nothing of the body is at a height of {height:.3f} m")
    if armless:
        return float(ConvexHull(section.vertices[:, [0, 2]]).area)
    loops = [loop[:, [0, 2]] for loop in section.discrete]
    nearest = min(loops, key=lambda loop: float(np.linalg.norm(loop.mean(axis=0) - middle)))
    return float(ConvexHull(nearest).area)


def girth_errors(
    fitted: Avatar, girths: dict[str, float], truth: TriangleMesh, *, armless: bool = False
) -> dict[str, float]:
    """Return name -> measured girth less the truth's at the same height [m].

    Args:
        fitted: A registered body; its rows say how high to slice.
        girths: What our tape reads on it [m], by row.
        truth: In the same frame [m].
        armless: Whether that is a trunk without arms.
    """
    height = {row: float(fitted.vertices[fitted.loops[row], 1].mean()) for row in girths}
    return {row: girths[row] - slice_girth(truth, height[row], armless=armless) for row in girths}
