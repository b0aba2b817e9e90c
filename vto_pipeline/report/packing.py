"""Compact encoding of meshes inside the page."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.io.gltf.principal_shapes import principal_shapes
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_SIGNED_STEPS = 32767
_MOVING_ERROR_M = 1e-3  # of a vertex that moves: half of what is seen at a body's size on a screen
_STEPS = 65535  # of a 16-bit coordinate: 0.03 mm on a body of two metres
_PICTURE_PX, _PICTURE_QUALITY = 2048, 85  # longest side, and JPEG quality: one or two megabytes


@dataclass(frozen=True)
class PackedMesh:
    """A mesh for the page.

    Args:
        mesh: What is shown.
        source: For each of its vertices the nearest vertex of the mesh it was made from, shape (V,).
    """

    mesh: TriangleMesh
    source: NDArray[np.integer]

    def geometry(self) -> dict[str, object]:
        """Positions and indices as plain JSON values.

        A coordinate is low + size * q / 65535, little-endian 16 bit, four per vertex of which the last is padding.
        """
        return self._within(self.mesh.vertices, self.mesh.vertices)

    def moving_geometry(self, frames: FloatArray) -> dict[str, object]:
        """The same of a surface that moves: a mean, and shapes that are added to it, a weight of each in every frame.

        They keep each vertex within 1 mm of its place. A shape is step * q, little-endian 16 bit, three per vertex.

        Args:
            frames: Of the mesh that this one was made from [m], shape (T, V, 3).
        """
        moving = frames[:, self.source]
        found = principal_shapes(moving, _MOVING_ERROR_M)
        step = max(float(np.abs(found.shapes).max(initial=0.0)) / _SIGNED_STEPS, 1e-12)
        shapes = [_base64(np.rint(shape / step).astype("<i2")) for shape in found.shapes]
        held = {"step": step, "shapes": shapes, "weights": np.round(found.weights, 6).tolist()}
        return self._within(found.base, moving.reshape(-1, 3)) | held

    def _within(self, positions: FloatArray, all_places: FloatArray) -> dict[str, object]:
        """Positions in the box about all places, and indices."""
        low = all_places.min(axis=0)
        size = np.maximum(all_places.max(axis=0) - low, 1e-9)
        grid = np.zeros((len(positions), 4), dtype="<u2")
        grid[:, :3] = np.rint((positions - low) / size * _STEPS)
        indices = _base64(self.mesh.faces.astype("<u4"))
        return {"low": low.tolist(), "size": size.tolist(), "positions": _base64(grid), "indices": indices}


def pack(mesh: TriangleMesh, triangles: int) -> PackedMesh:
    """Prepare a mesh for the page with at most about this many triangles; vertices without a face are dropped."""
    if len(mesh.faces) <= triangles:
        return PackedMesh(*submesh(mesh, np.ones(len(mesh.faces), dtype=bool)))
    small = decimate(mesh, triangles)
    return PackedMesh(small, cKDTree(mesh.vertices).query(small.vertices)[1])


def pack_colors(colors: ByteArray) -> str:
    """Return vertex colours, shape (V, 3), as base64 of four bytes per vertex."""
    padded = np.full((len(colors), 4), 255, dtype=np.uint8)
    padded[:, :3] = colors
    return _base64(padded)


def pack_places(uv: FloatArray) -> dict[str, object]:
    """Return texture coordinates, v down, shape (V, 2), as two numbers of 16 bit per vertex, with their range."""
    low = uv.min(axis=0)
    size = np.maximum(uv.max(axis=0) - low, 1e-9)
    grid = np.rint((uv - low) / size * _STEPS).astype("<u2")
    return {"places": _base64(grid), "placesLow": low.tolist(), "placesSize": size.tolist()}


def pack_picture(pixels: ByteArray) -> str:
    """Return a picture, shape (H, W, 3), as the address of a JPEG; one that is too large for a page is scaled down."""
    from PIL import Image

    image = Image.fromarray(pixels)
    image.thumbnail((_PICTURE_PX, _PICTURE_PX), Image.Resampling.BOX)
    stream = BytesIO()
    image.save(stream, "JPEG", quality=_PICTURE_QUALITY)
    return "data:image/jpeg;base64," + b64encode(stream.getvalue()).decode("ascii")


def _base64(array: NDArray[np.generic]) -> str:
    return b64encode(array.tobytes()).decode("ascii")
