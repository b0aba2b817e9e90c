"""Canonical order of vertices and faces, and removal of loose pieces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import ScanError
from vto_pipeline.geometry.topology import component_areas, submesh
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def canonical_mesh(vertices: FloatArray, faces: IntArray, colors: ByteArray | None) -> TriangleMesh:
    """Weld equal vertices, sort vertices and faces, drop faces without area.

    Two runs that find the same surface then give the same bits, whatever order the blocks were visited in.

    Args:
        vertices: [m], shape (V, 3).
        faces: Shape (F, 3).
        colors: Shape (V, 3), or None.

    Raises:
        ScanError: nothing is left.
    """
    keys = vertices.T[::-1] if colors is None else np.vstack([colors.T, vertices.T[::-1]])  # the last is the first
    order = np.lexsort(keys)
    ordered = vertices[order]
    first = np.ones(len(ordered), dtype=bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    new_index = np.empty(len(vertices), dtype=np.int32)
    new_index[order] = np.cumsum(first) - 1
    faces = new_index[faces]
    start = faces.argmin(axis=1)[:, None]
    faces = np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    faces = np.unique(faces, axis=0)
    if len(faces) == 0:
        raise ScanError("no surface was found", hint="are the depths in metres, and do the views overlap?")
    used, compact = np.unique(faces, return_inverse=True)
    corners = compact.reshape(-1, 3).astype(np.int32)
    kept = order[first][used]
    return TriangleMesh(vertices[kept], corners, None if colors is None else colors[kept])


def drop_small_pieces(mesh: TriangleMesh, min_share: float, job: Job) -> TriangleMesh:
    """Keep the pieces whose area is at least a share of the largest piece's."""
    piece, area = component_areas(mesh)
    keep = area >= min_share * area.max()
    job.measure(pieces=int(keep.sum()), pieces_dropped=int((~keep).sum()))
    if not keep.all():
        job.note(f"dropped {int((~keep).sum())} loose pieces, {100 * area[~keep].sum() / area.sum():.2f} % of the area")
    return submesh(mesh, keep[piece])[0]


def drop_vertices(mesh: TriangleMesh, bad: NDArray[np.bool_]) -> TriangleMesh:
    """Remove vertices and the faces that hold them.

    Raises:
        ScanError: nothing is left.
    """
    keep = np.asarray(~bad[mesh.faces].any(axis=1))
    if not keep.any():
        raise ScanError("no part of the surface is supported by the measurements", hint="are the poses right?")
    return submesh(mesh, keep)[0]
