"""From a triangle soup to a manifold, consistently oriented mesh. Every change is reported."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import edge_face_counts, face_components, half_edges, submesh
from vto_pipeline.model.arrays import IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.volume import FLAT, axis_volumes


class RepairConfig(Config):
    """How a mesh is repaired."""

    weld_mm: float = Field(
        default=0.001, ge=0, le=5, description="Vertices nearer than this are merged; 0 merges none [mm]"
    )


def repair(mesh: TriangleMesh, config: RepairConfig, job: Job) -> TriangleMesh:
    """Weld, drop degenerate and duplicate faces, orient outward, cut non-manifold edges and vertices apart.

    Faces without area but with three different vertices stay: to drop one would open a slit.

    Raises:
        InputError: nothing is left.
    """
    welded = _weld(mesh, config.weld_mm * 1e-3, job)
    oriented = _orient_alike(_drop_useless_faces(welded, job), job)
    return _orient_outward(_cut_apart(oriented, job), job)


def is_manifold(mesh: TriangleMesh, at: IntArray | None = None) -> bool:
    """Return whether each edge has one or two faces, and each used vertex one fan of faces; all of them, or those given
    and the edges there."""
    import igl

    faces, used = mesh.faces, at
    if at is None:
        used = np.unique(faces)
    else:
        here = np.zeros(len(mesh.vertices), dtype=bool)
        here[at] = True
        faces = faces[here[faces].any(axis=1)]
    _, counts = edge_face_counts(TriangleMesh(mesh.vertices, faces))
    if counts.max() > 2:
        return False
    return bool(igl.is_vertex_manifold(faces.astype(np.int64))[used].all())


def is_oriented(mesh: TriangleMesh) -> bool:
    """Return whether no two faces run the same way along an edge."""
    halves = half_edges(mesh).astype(np.int64)
    return len(np.unique(halves[:, 0] * len(mesh.vertices) + halves[:, 1])) == len(halves)


def _weld(mesh: TriangleMesh, tolerance: float, job: Job) -> TriangleMesh:
    """Merge vertices connected by steps within the tolerance; the first keeps its place."""
    if tolerance == 0.0:
        return mesh
    count = len(mesh.vertices)
    pairs = cKDTree(mesh.vertices).query_pairs(tolerance, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), (count, count))
    _, cluster = connected_components(graph, directed=False)
    _, first, label = np.unique(cluster, return_index=True, return_inverse=True)
    if len(first) == count:
        return mesh
    job.note(f"welded {count - len(first)} of {count} vertices nearer than {tolerance * 1e3:g} mm")
    colors = None if mesh.colors is None else mesh.colors[first]
    return TriangleMesh(mesh.vertices[first], label[mesh.faces].astype(np.int32), colors)


def _drop_useless_faces(mesh: TriangleMesh, job: Job) -> TriangleMesh:
    """Drop faces with a repeated vertex, and all but the first of faces with the same three vertices."""
    corners = np.sort(mesh.faces, axis=1)
    thin = (np.diff(corners, axis=1) == 0).any(axis=1)
    first = np.zeros(len(corners), dtype=bool)
    first[np.unique(corners, axis=0, return_index=True)[1]] = True
    for what, dropped in (("degenerate", thin), ("duplicate", ~first & ~thin)):
        if dropped.any():
            job.note(f"dropped {int(dropped.sum())} {what} faces")
    keep = first & ~thin
    if not keep.any():
        raise InputError(
            f"all {len(keep)} faces are degenerate", hint="is the unit right? vertices may have been merged"
        )
    return submesh(mesh, keep)[0]


def _orient_alike(mesh: TriangleMesh, job: Job) -> TriangleMesh:
    """Turn faces so that neighbours agree across every edge of two faces."""
    import igl

    oriented, _ = igl.bfs_orient(mesh.faces.astype(np.int64))
    turned = int((~_same_turn(oriented, mesh.faces)).sum())
    if turned:
        job.note(f"flipped {turned} of {len(oriented)} faces to agree with their neighbours")
    return TriangleMesh(mesh.vertices, oriented, mesh.colors)


def _same_turn(one: IntArray, other: IntArray) -> NDArray[np.bool_]:
    """Return whether two lists of faces over the same vertices run the same way round, shape (F,)."""
    turns = np.array([(one == np.roll(other, k, axis=1)).all(axis=1) for k in range(3)])
    return np.asarray(turns.any(axis=0))


def _cut_apart(mesh: TriangleMesh, job: Job) -> TriangleMesh:
    """Double the vertices along edges of more than two faces, and where fans of faces meet in one vertex only."""
    import igl

    if is_manifold(mesh):
        return mesh
    faces, source = igl.split_nonmanifold(mesh.faces.astype(np.int64))
    job.note(f"cut non-manifold edges and vertices apart: {len(mesh.vertices)} vertices became {len(source)}")
    return TriangleMesh(mesh.vertices[source], faces, None if mesh.colors is None else mesh.colors[source])


def _orient_outward(mesh: TriangleMesh, job: Job) -> TriangleMesh:
    """Turn each piece so that most of it faces away from its middle.

    The test is the sign of the volume between the piece and its centre of area (divergence theorem), which is the
    enclosed volume of a closed piece and still tells the sides of an open tube. A flat piece is left as it is.
    """
    count, piece = face_components(mesh)
    volumes, area = axis_volumes(mesh.vertices, mesh.faces, piece, count)
    inward = volumes.mean(axis=1) < -FLAT * area**1.5
    if not inward.any():
        return mesh
    turn = inward[piece]
    job.note(f"turned {int(inward.sum())} of {count} pieces outward")
    return TriangleMesh(mesh.vertices, np.where(turn[:, None], mesh.faces[:, ::-1], mesh.faces), mesh.colors)
