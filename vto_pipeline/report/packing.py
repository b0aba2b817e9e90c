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
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh

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
        low = self.mesh.vertices.min(axis=0)
        size = np.maximum(self.mesh.vertices.max(axis=0) - low, 1e-9)
        grid = np.zeros((len(self.mesh.vertices), 4), dtype="<u2")
        grid[:, :3] = np.rint((self.mesh.vertices - low) / size * _STEPS)
        return {
            "low": low.tolist(),
            "size": size.tolist(),
            "positions": _base64(grid),
            "indices": _base64(self.mesh.faces.astype("<u4")),
        }


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
