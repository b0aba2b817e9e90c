"""The picture of a scanned surface on the garment that was cut out of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh

_ON_SURFACE = 0.5
"""A face is filled, not scanned, where its middle is further from the surface than this share of its longest side."""

_FURTHEST = 3.0
"""Largest barycentric coordinate of a corner: the plane of a sliver tells nothing far beside it."""


def carry_skin(source: TriangleMesh, target: TriangleMesh) -> TexturedMesh:
    """Return a mesh with the picture of the surface that it was made from.

    A face takes the places of the surface's face under its middle, continued to its own corners. So what was cut out
    as it stands keeps its places, and no face reaches over the border of a chart. Where the surface has nothing, a face
    has the one colour of the nearest place.

    Args:
        source: With a picture, in the frame of the target [m].
        target: Cut, filled or thinned out of it [m].
    """
    assert source.skin is not None
    corners = target.vertices[target.faces]
    middle = corners.mean(axis=1)
    face, nearest, away = closest_points(middle, source.vertices, source.faces)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    under, laid = source.vertices[source.faces][face], source.skin.places[face]
    shares = np.stack([barycentric(corners[:, k], under) for k in range(3)], axis=1)
    filled = (away > _ON_SURFACE * longest) | (np.abs(shares) > _FURTHEST).any(axis=(1, 2))
    shares[filled] = barycentric(nearest[filled], under[filled])[:, None]
    places = np.einsum("fkc,fcd->fkd", shares, laid)
    picture = source.skin.picture
    return TexturedMesh(replace(target, texture=places, skin=None), picture, np.ones(picture.shape[:2], dtype=bool))
