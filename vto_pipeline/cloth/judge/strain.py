"""Strain of each triangle relative to its rest shape."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.membrane.slivers import SLIVER, slenderness
from vto_pipeline.model.arrays import FloatArray, IntArray

_FLAT = 1e-12  # of the largest: a triangle of less area at rest carries nothing


class RestTriangles(NamedTuple):
    """Triangles laid flat along their threads: warp is the vertical at rest, or the front where a triangle lies flat.

    Args:
        solid: Which triangles have an area at rest, shape (F,), bool.
        area: Of those [m²], shape (T,).
        inverse: Of their edges (first and second corner to the third) in warp and weft [1/m], shape (T, 2, 2).
    """

    solid: NDArray[np.bool_]
    area: FloatArray
    inverse: FloatArray


def rest_triangles(corners: FloatArray) -> RestTriangles:
    """Return the triangles of a rest shape, from their corners at rest [m], shape (F, 3, 3)."""
    one, two = _edges(corners)
    normal = np.cross(one, two)
    double_area = np.linalg.norm(normal, axis=1)
    solid = double_area > _FLAT * double_area.max(initial=0.0)
    one, two = one[solid], two[solid]
    normal = normal[solid] / double_area[solid, None]
    lies = np.abs(normal[:, 1]) > 0.95
    warp = np.where(lies[:, None], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    warp = warp - np.sum(warp * normal, axis=1, keepdims=True) * normal
    warp /= np.linalg.norm(warp, axis=1, keepdims=True)
    axes = np.stack([warp, np.cross(normal, warp)], axis=1)  # (T, thread, 3)
    flat = axes @ np.stack([one, two], axis=2)
    return RestTriangles(solid, 0.5 * double_area[solid], np.linalg.inv(flat))


def cloth_triangles(corners: FloatArray) -> RestTriangles:
    """Return the triangles that stand for cloth: as `rest_triangles`, but slivers, whose strain tells nothing.

    A move of a corner by a hair strains them without end; the cloth about them shows what there is.
    """
    laid = rest_triangles(corners)
    wide = slenderness(corners[laid.solid]) >= SLIVER
    if not wide.any():
        return laid
    solid = laid.solid.copy()
    solid[solid] = wide
    return RestTriangles(solid, laid.area[wide], laid.inverse[wide])


def gradients(positions: FloatArray, faces: IntArray, rest: RestTriangles) -> FloatArray:
    """Return the deformation gradient of each solid triangle, columns warp and weft, shape (T, 3, 2)."""
    one, two = _edges(positions[faces[rest.solid]])
    return np.asarray(np.stack([one, two], axis=2) @ rest.inverse)


def warp_weft_strains(gradient: FloatArray) -> FloatArray:
    """Return stretch of warp and weft, and the angle by which they are sheared [rad], shape (T, 3)."""
    warp, weft = np.linalg.norm(gradient, axis=1).T
    cosine = np.sum(gradient[:, :, 0] * gradient[:, :, 1], axis=1) / np.maximum(warp * weft, np.finfo(float).tiny)
    return np.column_stack([warp - 1.0, weft - 1.0, np.arcsin(np.clip(cosine, -1.0, 1.0))])


def principal_strains(gradient: FloatArray) -> FloatArray:
    """Return the largest and the least stretch of each triangle in any direction, less one, shape (T, 2)."""
    return np.asarray(np.linalg.svd(gradient, compute_uv=False)) - 1.0


def _edges(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    return corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]
