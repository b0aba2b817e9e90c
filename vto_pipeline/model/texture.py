"""A surface with a picture on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray, freeze
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class TexturedMesh:
    """A mesh, the picture on it, and which of its texels a photo shows.

    Args:
        mesh: Surface [m]; its texture coordinates run from (0, 0), the lower left corner of the picture, to (1, 1).
        picture: sRGB, the upper row first, shape (H, W, 3).
        seen: Whether a texel's colour was observed, shape (H, W); elsewhere it is a guess from its surroundings.

    Raises:
        InputError: no texture coordinates, or shapes that do not go together.
    """

    mesh: TriangleMesh
    picture: ByteArray
    seen: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if self.mesh.texture is None:
            raise InputError("a textured mesh needs texture coordinates")
        object.__setattr__(self, "picture", freeze("texture", self.picture, (None, None, 3), "u1"))
        object.__setattr__(self, "seen", freeze("seen texels", self.seen, self.picture.shape[:2], "?"))
