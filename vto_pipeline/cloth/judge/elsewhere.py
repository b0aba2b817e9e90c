"""Whether a garment ended far from where it was put on."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from vto_pipeline.geometry.section import plane_section
from vto_pipeline.geometry.topology import boundary_loops, edge_faces, edges, laid_edge_lengths
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_FAR = 0.1  # of the stature: from the waist to below the hips, or to the chest; what slips into place goes less
_AROUND = 0.1  # m: shorter openings go around no trunk, neck or limb


def warn_if_elsewhere(
    start: TriangleMesh, draped: TriangleMesh, rest: RestShape, body: TriangleMesh, job: Job
) -> dict[str, object]:
    """Warn if a garment as a whole slid far up or down the body, with girths that tell why, and return how far.

    Args:
        start: The garment where it was put on [m].
        draped: The same triangles at the end [m].
        rest: Its rest shape, which tells its girths.
        body: What it lies on [m].
        job: Warned with the girth of the opening that was highest, from which it hangs, and those of the body within.

    Returns:
        risen_mm: how far that opening went up; nothing where there is none.
    """
    around = [(loop, _laid_length(draped, rest, loop)) for loop in boundary_loops(draped)]
    around = [(loop, length) for loop, length in around if length > _AROUND]
    if not around:
        return {}
    top, own = max(around, key=lambda one: float(start.vertices[one[0], 1].mean()))
    began, ended = (mesh.vertices[top].mean(axis=0) for mesh in (start, draped))
    risen = float(ended[1] - began[1])
    whole = float(np.median(draped.vertices[:, 1] - start.vertices[:, 1]))  # a cuff alone goes down with its arm
    if min(abs(risen), abs(whole)) > _FAR * float(np.ptp(body.vertices[:, 1])):
        way = "above" if risen > 0 else "below"
        job.warn(
            f"it is worn elsewhere: it ended {100 * abs(risen):.0f} cm {way} where it was put on. Its upper opening is "
            f"{100 * own:.0f} cm around, and the body {100 * girth_at(body, ended):.0f} cm there, "
            f"{100 * girth_at(body, began):.0f} cm where it was put on"
        )
    return {"risen_mm": 1e3 * risen}


def girth_at(body: TriangleMesh, place: FloatArray) -> float:
    """Return the tight girth of what of a body is nearest to a place, at its height; zero where nothing is [m].

    Args:
        body: [m].
        place: [m], shape (3,).
    """
    section = plane_section(body, place, np.array([0.0, 1.0, 0.0]))
    parts = [section.points[part][:, [0, 2]] for part in section.parts()]
    parts = [points for points in parts if len(points) > 2]
    if not parts:
        return 0.0
    nearest = min(parts, key=lambda points: float(np.linalg.norm(points.mean(axis=0) - place[[0, 2]])))
    return float(ConvexHull(nearest).area)


def _laid_length(mesh: TriangleMesh, rest: RestShape, loop: IntArray) -> float:
    """Return how long a loop of a mesh's boundary is in the rest shape, panels or not [m]."""
    ours = np.isin(edges(mesh), loop).all(axis=1) & (edge_faces(mesh)[:, 1] < 0)
    return float(laid_edge_lengths(mesh, rest.corners(mesh.faces))[ours].sum())
