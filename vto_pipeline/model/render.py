"""Mesh parts with materials, for rendering."""

from __future__ import annotations

from dataclasses import dataclass

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray, FloatArray, freeze
from vto_pipeline.model.mesh import TriangleMesh

SKIN = (214, 181, 156)
"""Colour of a body that has none of its own, sRGB."""


@dataclass(frozen=True)
class GlbPart:
    """A mesh with a metallic-roughness material, as glTF has it.

    Args:
        name: For people and programs; unique in its file.
        mesh: Surface [m]; its colours multiply the material's.
        normals: Unit normals, shape (V, 3), or None: flat shading.
        uv: Texture coordinates, (0, 0) the upper left corner of the picture, shape (V, 2), or None.
        texture: sRGB picture, shape (H, W, 3), or None; needs `uv`.
        base_color: Linear RGB and opacity, 0 to 1.
        roughness, metallic: 0 to 1.
        double_sided: Whether the back is drawn.
    """

    name: str
    mesh: TriangleMesh
    normals: FloatArray | None = None
    uv: FloatArray | None = None
    texture: ByteArray | None = None
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    roughness: float = 0.9
    metallic: float = 0.0
    double_sided: bool = True

    def __post_init__(self) -> None:
        count = len(self.mesh.vertices)
        if self.normals is not None:
            object.__setattr__(self, "normals", freeze(f"{self.name} normals", self.normals, (count, 3), "f8"))
        if self.uv is not None:
            object.__setattr__(self, "uv", freeze(f"{self.name} uv", self.uv, (count, 2), "f8"))
        if self.texture is not None:
            if self.uv is None:
                raise InputError(f"{self.name} has a texture but no texture coordinates")
            object.__setattr__(self, "texture", freeze(f"{self.name} texture", self.texture, (None, None, 3), "u1"))
        if not all(0 <= value <= 1 for value in (*self.base_color, self.roughness, self.metallic)):
            raise InputError(f"{self.name}: colour, roughness and metallic must lie between 0 and 1")
