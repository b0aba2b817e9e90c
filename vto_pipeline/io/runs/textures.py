"""A surface with its picture, in a run's folder."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import read_arrays, write_arrays
from vto_pipeline.io.files import replacing
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh


def write_texture(path: Path, value: TexturedMesh) -> None:
    """Write texture.npz: vertices, faces, colors, texture coordinates; picture and mask as PNG files."""
    mesh = value.mesh
    arrays = {"vertices": mesh.vertices, "faces": mesh.faces, "coordinates": mesh.texture, "metric": mesh.metric}
    pictures = {"picture": _png(value.picture), "seen": _png(_mask(value))}
    colors = {} if mesh.colors is None else {"colors": mesh.colors}
    write_arrays(path, {**arrays, **pictures, **colors})


def read_texture(path: Path) -> TexturedMesh:
    """Read texture.npz.

    Raises:
        FormatError: not what `write_texture` wrote.
    """
    arrays = read_arrays(path, required=("vertices", "faces", "coordinates", "metric", "picture", "seen"))
    try:
        mesh = TriangleMesh(
            arrays["vertices"], arrays["faces"], arrays.get("colors"), arrays["coordinates"], bool(arrays["metric"])
        )
        return TexturedMesh(mesh, _pixels(arrays["picture"], "RGB"), _pixels(arrays["seen"], "L") > 0)
    except (InputError, OSError, SyntaxError) as e:
        raise FormatError(f"not a textured surface: {e}", where=str(path)) from None


def write_texture_picture(path: Path, value: TexturedMesh) -> None:
    """Write the picture as PNG."""
    with replacing(path) as beside:
        beside.write_bytes(_png(value.picture).tobytes())


def write_texture_mask(path: Path, value: TexturedMesh) -> None:
    """Write which texels a photo shows as PNG: white where one does, black where the colour is a guess."""
    with replacing(path) as beside:
        beside.write_bytes(_png(_mask(value)).tobytes())


def _mask(value: TexturedMesh) -> NDArray[np.uint8]:
    return np.where(value.seen, 255, 0).astype(np.uint8)


def _png(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", compress_level=4)
    return np.frombuffer(stream.getvalue(), np.uint8)


def _pixels(png: NDArray[np.uint8], mode: str) -> NDArray[np.uint8]:
    from PIL import Image

    with Image.open(io.BytesIO(png.tobytes()), formats=("PNG",)) as image:
        return np.array(image.convert(mode))
