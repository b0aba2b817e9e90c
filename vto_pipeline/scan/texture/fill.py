"""Colours where no photo shows the surface, and between the charts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.laplace import extend_smoothly
from vto_pipeline.geometry.topology import face_components
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.texture.charts import nearest_pixel


def fill_vertices(mesh: TriangleMesh, colors: FloatArray, seen: NDArray[np.bool_]) -> FloatArray:
    """Return vertex colours (V, 3) with those that no photo shows filled in from around them, on the surface.

    They are harmonic; a piece of which nothing is seen gets the mean of all.

    Args:
        mesh: The surface.
        colors: 0 to 255, shape (V, 3).
        seen: Which are known, shape (V,).
    """
    if seen.all():
        return colors
    mean = colors[seen].mean(axis=0) if seen.any() else np.full(3, 128.0)
    count, piece = face_components(mesh)
    of_vertex = np.zeros(len(seen), dtype=np.int64)
    of_vertex[mesh.faces] = piece[:, None]
    known = np.bincount(of_vertex[seen], minlength=count) > 0
    lost = ~seen & ~known[of_vertex]
    start = np.where(lost[:, None], mean, colors)
    return extend_smoothly(mesh, start, ~seen & ~lost, 1)


def fill_between(picture: ByteArray, inside: NDArray[np.bool_]) -> ByteArray:
    """Return a picture, shape (H, W, 3), whose pixels outside the charts have the colour of the nearest one inside."""
    return np.asarray(picture.reshape(-1, 3)[nearest_pixel(inside)[1]])
