"""A render mesh with its materials, as one mesh with vertex colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.geometry.topology import concatenate
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb


def join_parts(parts: Sequence[GlbPart]) -> TriangleMesh:
    """Return all parts as one mesh; its colours are None when no part has any.

    Args:
        parts: At least one.
    """
    plain = all(
        part.mesh.colors is None and part.texture is None and part.base_color[:3] == (1, 1, 1) for part in parts
    )
    whole = concatenate([part.mesh for part in parts])
    return whole if plain else replace(whole, colors=np.vstack([_colors(part) for part in parts]))


def _colors(part: GlbPart) -> ByteArray:
    """Vertex colour times texture times base colour, multiplied as glTF 2.0 section 3.9.2 has it: in linear light."""
    linear = np.tile(np.array(part.base_color[:3]), (len(part.mesh.vertices), 1))
    if part.mesh.colors is not None:
        linear = linear * decode_srgb(part.mesh.colors)
    if part.texture is not None and part.uv is not None:
        height, width = part.texture.shape[:2]
        column, row = np.floor(part.uv % 1.0 * [width, height]).astype(int).T
        linear = linear * decode_srgb(part.texture[np.minimum(row, height - 1), np.minimum(column, width - 1)])
    return encode_srgb(linear)
