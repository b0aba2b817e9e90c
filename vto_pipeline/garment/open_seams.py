"""Seams that a file leaves open: rims that run along each other, edge by edge, hardly a cloth apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.geometry.remeshing.repair import RepairConfig, is_manifold
from vto_pipeline.geometry.topology import boundary_walks, corners_from
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_SHORT = 0.2
"""Of an edge's length: the ends of a seam's edges lie nearer. Rims that are further apart for their triangles are two
rims, however fine the mesh."""

_FOLDED = 0.5
"""Cosine of the angle between two pieces of cloth at their rims: sharper, the one is a lining of the other."""


class TakeMeshConfig(RepairConfig):
    """How a garment's mesh is taken in."""

    sew_mm: float = Field(
        2.0, ge=0, le=10, description="Rims that run along each other with a smaller gap are sewn; 0 sews none [mm]"
    )


def sew_open_seams(mesh: TriangleMesh, within: float, job: Job) -> TriangleMesh:
    """Join rims whose edges pair off end to end, each the nearest of the other.

    Modellers keep parts apart that a garment has in one: a brace ends in vertices of its own on the edge of the back.
    Simulated, it would fall off. Joined vertices lie in the middle. Faces keep their order.

    Args:
        mesh: Manifold and oriented.
        within: How far the ends of two such edges may be apart [m].
        job: Receives the length that was sewn.

    Returns:
        The mesh itself where no seam is open, or where it would no longer be a manifold.
    """
    walks = boundary_walks(mesh)
    if not walks or within == 0.0:
        return mesh
    rim = mesh.faces.reshape(-1)[corners_from(np.concatenate(walks))]
    one, other = _pairs(mesh.vertices, rim, within)
    if len(one) == 0:
        return mesh
    ends = np.vstack([np.column_stack([rim[one, 0], rim[other, 1]]), np.column_stack([rim[one, 1], rim[other, 0]])])
    sewn = _merged(mesh, ends)
    length = float(np.linalg.norm(np.diff(mesh.vertices[rim[one, :2]], axis=1), axis=2).sum())
    told = f"{1e3 * length:.0f} mm of rims that lie within {1e3 * within:g} mm of each other"
    if sewn is None or not is_manifold(sewn):
        job.warn(f"{told} stay open: sewn, cloth would meet itself otherwise than in a seam")
        return mesh
    job.note(f"sewed {told}; sew_mm=0 leaves them open")
    return sewn


def _pairs(points: FloatArray, rim: IntArray, within: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return which edges of rims are one seam, each pair once: they run opposite ways at one place, and the cloth goes
    on beyond. Rims of a lining do too, but it lies on the same side.

    Args:
        points: [m], shape (V, 3).
        rim: Start and end of each edge, and the third corner of its face, shape (R, 3).
        within: How far the ends may be apart [m].
    """
    start, end, third = (points[rim[:, k]] for k in range(3))
    here, there = np.hstack([start, end]), np.hstack([end, start])
    reach = np.sqrt(2.0) * within  # the distance is over both ends
    far, nearest = cKDTree(there).query(here, distance_upper_bound=reach)
    mine = np.flatnonzero(np.isfinite(far))
    mutual = mine[nearest[nearest[mine]] == mine]
    one = mutual[mutual < nearest[mutual]]
    other = nearest[one]
    apart = np.maximum(np.linalg.norm(start[one] - end[other], axis=1), np.linalg.norm(end[one] - start[other], axis=1))
    edge = end - start
    length = np.linalg.norm(edge, axis=1)
    along = edge / np.maximum(length, 1e-30)[:, None]
    inward = third - start - np.einsum("rk,rk->r", third - start, along)[:, None] * along
    inward /= np.maximum(np.linalg.norm(inward, axis=1), 1e-30)[:, None]
    goes_on = np.einsum("rk,rk->r", inward[one], inward[other]) < _FOLDED
    seam = (apart <= np.minimum(within, _SHORT * np.minimum(length[one], length[other]))) & goes_on
    return one[seam], other[seam]


def _merged(mesh: TriangleMesh, pairs: IntArray) -> TriangleMesh | None:
    """Return the mesh with vertices joined in the middle, unused ones dropped; None where a face would collapse."""
    count = len(mesh.vertices)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (count, count))
    _, cluster = connected_components(graph, directed=False)
    used = np.zeros(count, dtype=bool)
    used[mesh.faces] = True
    label, inverse, several = np.unique(cluster[used], return_inverse=True, return_counts=True)
    middle = np.column_stack([np.bincount(inverse, mesh.vertices[used, k]) for k in range(3)]) / several[:, None]
    faces = np.searchsorted(label, cluster[mesh.faces]).astype(np.int32)
    if (faces == np.roll(faces, 1, axis=1)).any():
        return None
    colors = None
    if mesh.colors is not None:
        first = np.flatnonzero(used)[np.unique(inverse, return_index=True)[1]]
        colors = mesh.colors[first]
    return TriangleMesh(middle, faces, colors)
