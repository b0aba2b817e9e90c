"""Decimation: fewer triangles for the same surface."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.geometry.topology import submesh, surface_area
from vto_pipeline.model.mesh import TriangleMesh


def decimate(mesh: TriangleMesh, triangles: int, *, aggressiveness: float = 7.0) -> TriangleMesh:
    """Return the mesh with at most about this many triangles; its borders stay where they are.

    Quadric decimation (Garland and Heckbert 1997), by pyfqmr. Vertices take the colour of the nearest old one; those
    without a face are dropped.

    Args:
        mesh: A mesh; returned as it is when it is small enough.
        triangles: Wanted number of faces.
        aggressiveness: pyfqmr's; lower keeps closer to the surface and takes longer.
    """
    if len(mesh.faces) <= triangles:
        return mesh
    import pyfqmr

    simplifier = pyfqmr.Simplify()
    simplifier.setMesh(mesh.vertices.copy(), mesh.faces.copy())  # it refuses read-only arrays
    simplifier.simplify_mesh(target_count=triangles, aggressiveness=aggressiveness, preserve_border=True, verbose=False)
    vertices, faces, _ = simplifier.getMesh()
    colors = None if mesh.colors is None else mesh.colors[cKDTree(mesh.vertices).query(vertices)[1]]
    return submesh(TriangleMesh(vertices, faces, colors), np.ones(len(faces), dtype=bool))[0]


def faces_at(mesh: TriangleMesh, edge: float) -> int:
    """Return how many equilateral triangles of an edge length [m] cover the mesh's area."""
    area = surface_area(mesh)
    return int(np.ceil(area / (np.sqrt(3.0) / 4.0 * edge**2)))
