"""A GLB within a web page's limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vto_pipeline.errors import InputError
from vto_pipeline.io.files import replacing
from vto_pipeline.io.gltf.write import GlbLayout, glb_bytes
from vto_pipeline.model.render import GlbPart

LIMIT_BYTES = 5_000_000
"""Of a file."""

_QUALITIES = (92, 85, 75, 60)
"""Of JPEG pictures: the best with which the file is small enough. Fine patterns smear below the last."""

_EXACT_PIXELS = 64 * 64


def write_web_glb(path: Path, parts: Sequence[GlbPart]) -> int:
    """Write parts as a GLB with quantised coordinates and JPEG pictures; return the pictures' quality.

    Raises:
        InputError: no part, two of one name, or the file would be too large.
    """
    for quality in _QUALITIES:
        data = glb_bytes(parts, GlbLayout(quality, _EXACT_PIXELS, quantised=True))
        if len(data) <= LIMIT_BYTES:
            with replacing(path) as beside:
                beside.write_bytes(data)
            return quality
    raise InputError(
        f"{len(data) / 1e6:.1f} MB even with coarse pictures; {LIMIT_BYTES / 1e6:g} MB are allowed",
        where=str(path),
        hint="thin out the garments: transfer.max_triangles, texture.max_triangles",
    )
