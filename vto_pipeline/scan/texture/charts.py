"""The charts of a texture: the surface cut open and laid flat in one picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import surface_area
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise

GUTTER = 4
"""Texels between two charts, so that the picture may be scaled down without mixing them."""

CROWDED = 0.55
"""Share of an atlas that charts fill, before they are packed: to guess the size of a texel that fits."""


MARGIN = 2
"""Texels beyond the edge of a chart that are coloured as if it went on: what is read at the edge mixes them in."""

FURTHEST = 2.0
"""Largest barycentric coordinate of a texel in the margin: a sliver's plane tells nothing far beside it."""


class Texels(NamedTuple):
    """The texels of all charts and of their margins, N of them.

    Args:
        row, column: Where each is in the picture, shape (N,).
        face: The triangle under its centre, or near it, shape (N,).
        weight: Barycentric coordinates of its centre there, shape (N, 3); negative ones in a margin.
        inside: Which lie in a chart, shape (N,).
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    face: IntArray
    weight: FloatArray
    inside: NDArray[np.bool_]


def unwrap(mesh: TriangleMesh, texel: float, largest: int) -> tuple[FloatArray, tuple[int, int]]:
    """Cut a surface into flat charts and pack them into one picture, by xatlas.

    Args:
        mesh: The surface [m].
        texel: Wanted side of a texel [m]; larger where the picture would become too large.
        largest: Longest side of the picture [px].

    Returns:
        Texture coordinates of each face's corners, v up, 0 to 1, shape (F, 3, 2); width and height of the picture [px].
    """
    import xatlas

    area = surface_area(mesh)
    texel = max(texel, float(np.sqrt(area / CROWDED)) / largest)
    atlas = xatlas.Atlas()
    atlas.add_mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    charts.max_iterations = 1
    packing.padding, packing.bilinear, packing.create_image = GUTTER, True, False
    packing.rotate_charts, packing.bruteForce = True, False
    while True:
        packing.texels_per_unit = 1.0 / texel
        packing.resolution = 0
        atlas.generate(charts, packing)
        if max(atlas.width, atlas.height) <= largest and atlas.atlas_count == 1:
            break
        texel *= 1.05 * max(1.0, max(atlas.width, atlas.height) / largest)
    _, corners, uv = atlas[0]
    flat = uv.astype(np.float64)[corners.reshape(-1, 3)]
    flat[..., 1] = 1.0 - flat[..., 1]
    return flat, (atlas.width, atlas.height)


def texels_of(corners: FloatArray, size: tuple[int, int]) -> Texels:
    """Return the texels whose centres lie in a chart, and those of the margins.

    Args:
        corners: Texture coordinates of each face's corners, v up, 0 to 1, shape (F, 3, 2).
        size: Width and height of the picture [px].
    """
    width, height = size
    placed = np.zeros((len(corners), 3, 3))
    placed[..., 0] = corners[..., 0] * width - 0.5
    placed[..., 1] = (1.0 - corners[..., 1]) * height - 0.5
    face, _, _ = rasterise(placed, width, height)
    away, nearest = nearest_pixel(face >= 0)
    row, column = np.nonzero(away <= MARGIN)
    owner = face.reshape(-1)[nearest[row, column]]
    weight = _barycentric(placed[owner, :, :2], np.column_stack([column, row]).astype(float))
    inside = face[row, column] >= 0
    kept = inside | (np.abs(weight) <= FURTHEST).all(axis=1)
    return Texels(row[kept], column[kept], owner[kept], weight[kept], inside[kept])


def nearest_pixel(inside: NDArray[np.bool_]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return how far each pixel is from the next one inside [px], and that one's place in the flat picture, (H, W)."""
    import cv2

    away, label = cv2.distanceTransformWithLabels(
        (~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.zeros(int(label.max()) + 1, dtype=np.int64)
    source[label[inside]] = np.flatnonzero(inside)
    return np.asarray(away, dtype=np.float32), source[label]


def _barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Barycentric coordinates of points (N, 2) in triangles (N, 3, 2), shape (N, 3)."""
    ab, ac, ap = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    v = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / area
    w = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / area
    return np.column_stack([1.0 - v - w, v, w])
