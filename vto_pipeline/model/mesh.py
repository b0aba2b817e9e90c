"""Surfaces and clouds."""

from __future__ import annotations

from dataclasses import dataclass

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray, freeze
from vto_pipeline.notebook import Presented


@dataclass(frozen=True)
class Skin:
    """A picture on a mesh, as a file gave it.

    Args:
        places: Where each face's corners are in it, (0, 0) the lower left corner, (1, 1) the upper right one, repeated
            beyond, shape (F, 3, 2).
        picture: sRGB, the upper row first, shape (H, W, 3).
    """

    places: FloatArray
    picture: ByteArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "places", freeze("places in the picture", self.places, (None, 3, 2), "f8"))
        object.__setattr__(self, "picture", freeze("picture", self.picture, (None, None, 3), "u1"))


@dataclass(frozen=True)
class TriangleMesh(Presented):
    """A triangle mesh in metres, +Y up.

    Args:
        vertices: Positions [m], shape (V, 3).
        faces: Vertex indices, counter-clockwise seen from outside, shape (F, 3); at least one.
        colors: sRGB, shape (V, 3), or None.
        texture: Texture coordinates of each face's corners, v up, in whatever unit, shape (F, 3, 2), or None. What
            makes another mesh of this one does without them.
        metric: Whether lengths are metres; if not, their unit is unknown, as of photos without a scale.
        skin: Its picture, or None. What makes another mesh of this one does without it, too.

    Raises:
        InputError: wrong shape, not finite, no face, or an index out of range.
    """

    vertices: FloatArray
    faces: IntArray
    colors: ByteArray | None = None
    texture: FloatArray | None = None
    metric: bool = True
    skin: Skin | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", freeze("vertices", self.vertices, (None, 3), "f8"))
        object.__setattr__(self, "faces", freeze("faces", self.faces, (None, 3), "i4"))
        count = len(self.vertices)
        if len(self.faces) == 0:
            raise InputError(f"mesh has no faces ({count} vertices)", hint="is it a point cloud?")
        low, high = int(self.faces.min()), int(self.faces.max())
        if low < 0 or high >= count:
            raise InputError(f"face index {low if low < 0 else high} is outside 0..{count - 1}")
        if self.colors is not None:
            object.__setattr__(self, "colors", freeze("colors", self.colors, (count, 3), "u1"))
        if self.texture is not None:
            shape = (len(self.faces), 3, 2)
            object.__setattr__(self, "texture", freeze("texture coordinates", self.texture, shape, "f8"))
        if self.skin is not None and len(self.skin.places) != len(self.faces):
            raise InputError(f"{len(self.skin.places)} places in the picture for {len(self.faces)} faces")


@dataclass(frozen=True)
class PointCloud:
    """Points on a surface.

    Args:
        points: Positions [m], shape (N, 3); at least one.
        normals: Unit normals, shape (N, 3), or None.
        colors: sRGB, shape (N, 3), or None.
    """

    points: FloatArray
    normals: FloatArray | None = None
    colors: ByteArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", freeze("points", self.points, (None, 3), "f8"))
        count = len(self.points)
        if count == 0:
            raise InputError("point cloud is empty")
        if self.normals is not None:
            object.__setattr__(self, "normals", freeze("normals", self.normals, (count, 3), "f8"))
        if self.colors is not None:
            object.__setattr__(self, "colors", freeze("colors", self.colors, (count, 3), "u1"))
