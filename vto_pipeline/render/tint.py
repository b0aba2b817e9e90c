"""One colour for a whole mesh."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import SKIN

__all__ = ["CLOTH", "MARK", "SKIN", "Rgb", "tint"]

Rgb = tuple[int, int, int]

CLOTH: Rgb = (106, 143, 192)
MARK: Rgb = (214, 39, 40)


def tint(mesh: TriangleMesh, color: Rgb) -> TriangleMesh:
    """Return the mesh with this sRGB colour at every vertex."""
    return TriangleMesh(mesh.vertices, mesh.faces, np.tile(np.array(color, dtype=np.uint8), (len(mesh.vertices), 1)))
