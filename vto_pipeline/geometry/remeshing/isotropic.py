"""Isotropic remeshing with gpytoolbox."""

from __future__ import annotations

import warnings

import numpy as np

from vto_pipeline.model.arrays import IntArray
from vto_pipeline.model.mesh import TriangleMesh


def isotropic(
    mesh: TriangleMesh,
    edge: float,
    rounds: int,
    *,
    features: IntArray | None,
    project: bool,
    fixed: IntArray | tuple[int, ...] = (),
) -> TriangleMesh:
    """Return the mesh in triangles of about one edge length: rounds of split, collapse, flip and relax.

    Botsch and Kobbelt 2004, "A remeshing approach to multiresolution modeling".

    Args:
        mesh: Manifold. Its fixed vertices come first in the result, then those of its boundary, in their old order and
            unmoved.
        edge: Wanted edge length [m].
        rounds: How often.
        features: Edges to keep as lines, along which vertices may slide, shape (N, 2).
        project: Whether vertices are put back onto the old surface.
        fixed: Vertices that stay where they are, in features too.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it imports a deprecated SciPy name, and warns when there is nothing to do
        import gpytoolbox

        vertices, faces = gpytoolbox.remesh_botsch(
            mesh.vertices.copy(),
            mesh.faces.copy(),
            rounds,
            edge,
            project,
            feature=np.asarray(fixed, dtype=np.int64),
            feature_edges=features,
        )
    return TriangleMesh(np.asarray(vertices), np.asarray(faces, dtype=np.int32))
