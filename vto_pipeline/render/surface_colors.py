"""The colour of a surface at places of its triangles."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import Skin, TriangleMesh
from vto_pipeline.numerics.resample import bilinear

_CLOTH = np.array([205, 206, 203], dtype=np.uint8)


def surface_colors(mesh: TriangleMesh, faces: IntArray, shares: FloatArray) -> FloatArray:
    """Return sRGB 0 to 255 from its picture, else its vertices, else of undyed cloth; shape (N, 3).

    Args:
        mesh: The surface.
        faces: On which of its triangles each place lies, shape (N,).
        shares: Of the triangle's corners, shape (N, 3).
    """
    if mesh.skin is not None:
        return _from_picture(mesh.skin, faces, shares)
    colors = np.broadcast_to(_CLOTH, mesh.vertices.shape) if mesh.colors is None else mesh.colors
    blended: FloatArray = np.einsum("nc,nck->nk", shares, colors[mesh.faces[faces]].astype(np.float64))
    return blended


def _from_picture(skin: Skin, faces: IntArray, shares: FloatArray) -> FloatArray:
    height, width = skin.picture.shape[:2]
    if min(height, width) < 2:  # a plain colour
        return np.broadcast_to(skin.picture.reshape(-1, 3)[0].astype(np.float64), (len(faces), 3))
    return _sampled(skin.picture, skin.places, faces, shares)


@njit(cache=True, error_model="numpy", parallel=True)
def _sampled(picture, places, faces, shares):  # type: ignore[no-untyped-def]  # typed by Numba
    height, width = picture.shape[:2]
    out = np.empty((len(faces), 3))
    for n in prange(len(faces)):
        u = v = 0.0
        for c in range(3):
            u += shares[n, c] * places[faces[n], c, 0]
            v += shares[n, c] * places[faces[n], c, 1]
        u, v = u - np.ceil(u) + 1.0, v - np.ceil(v) + 1.0  # repeated beyond; 1 stays 1
        for k in range(3):
            out[n, k] = bilinear(picture, u * width - 0.5, (1.0 - v) * height - 0.5, k)
    return out
