"""The pictures on the parts of a glTF scene, as one picture."""

from __future__ import annotations

import io
import warnings
from base64 import b64decode
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.gltf.document import GltfDocument
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb

LARGEST_PX = 8192
"""Longest side of a picture, alone or stacked."""

_PLAIN_PX = 4  # side of the patch of a part without a picture
_DATA = ("data:image/png;base64,", "data:image/jpeg;base64,")


def scene_picture(
    document: GltfDocument, primitives: Sequence[Mapping[str, Any]], places: Sequence[FloatArray]
) -> tuple[ByteArray, FloatArray] | None:
    """Return the base colour pictures of all parts as one, and the texture coordinates there; None if there are none.

    Args:
        document: The file.
        primitives: Its parts.
        places: Texture coordinates of each part's corners, v up, each of shape (F, 3, 2).

    Returns:
        sRGB, shape (H, W, 3); texture coordinates of all corners, v up, shape (F, 3, 2).

    Raises:
        FormatError: a picture is outside the file, no PNG or JPEG, broken, or too large; or they cannot be joined.
    """
    found: dict[Any, tuple[ByteArray, bool]] = {}
    try:
        materials = [primitive.get("material") for primitive in primitives]
        for material in materials:
            if material not in found:
                found[material] = _base_color(
                    document, {} if material is None else document.item("materials", material)
                )
    except (AttributeError, KeyError, TypeError, ValueError) as e:
        raise FormatError(f"a material is broken: {e!r}", where=str(document.path)) from None
    if not any(shown for _, shown in found.values()):
        return None
    return _stack([found[material][0] for material in materials], places)


def _base_color(document: GltfDocument, material: Mapping[str, Any]) -> tuple[ByteArray, bool]:
    """Return a material's base colour, sRGB, shape (H, W, 3), and whether it is a picture or one plain colour."""
    surface = material.get("pbrMetallicRoughness", {})
    factor = np.clip(np.asarray(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), dtype=np.float64)[:3], 0.0, 1.0)
    chosen = surface.get("baseColorTexture")
    if chosen is None or chosen.get("texCoord", 0) != 0 or "KHR_texture_transform" in chosen.get("extensions", {}):
        return np.tile(encode_srgb(factor), (_PLAIN_PX, _PLAIN_PX, 1)), False
    image = document.item("images", document.item("textures", chosen["index"]).get("source"))
    picture = _decode(_bytes(document, image), str(document.path))
    return (picture if (factor == 1.0).all() else encode_srgb(decode_srgb(picture) * factor)), True


def _stack(pictures: Sequence[ByteArray], places: Sequence[FloatArray]) -> tuple[ByteArray, FloatArray]:
    """Return the parts' pictures one above the other, and the texture coordinates there."""
    if all(picture is pictures[0] for picture in pictures):
        return pictures[0], np.concatenate(places)
    height, width = sum(len(picture) for picture in pictures), max(picture.shape[1] for picture in pictures)
    if max(height, width) > LARGEST_PX:
        raise FormatError(f"the pictures have {width} x {height} pixels together; the limit is {LARGEST_PX} a side")
    whole, moved, row = np.zeros((height, width, 3), np.uint8), [], 0
    for picture, place in zip(pictures, places, strict=True):
        own = place - np.floor(place.min(axis=1, keepdims=True) + 1e-6)
        if own.max(initial=0.0) > 1.0 + 1e-4:
            raise FormatError("a picture is repeated within a triangle, and there are several pictures")
        tall, wide = picture.shape[:2]
        whole[row : row + tall, :wide], whole[row : row + tall, wide:] = picture, picture[:, -1:]
        u, v = own[..., 0] * wide / width, 1.0 - (row + (1.0 - own[..., 1]) * tall) / height
        moved.append(np.stack([u, v], axis=-1))
        row += tall
    return whole, np.concatenate(moved)


def _bytes(document: GltfDocument, image: Mapping[str, Any]) -> bytes:
    if "bufferView" in image:
        return document.view(image["bufferView"])[0]
    uri = str(image.get("uri", ""))
    if not uri.startswith(_DATA):
        raise FormatError("a picture lies in a file of its own", where=str(document.path), hint="save it as .glb")
    try:
        return b64decode(uri.partition(",")[2], validate=True)
    except ValueError:
        raise FormatError("a picture is not base64", where=str(document.path)) from None


def _decode(data: bytes, where: str) -> ByteArray:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is lower
            with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
                if max(image.size) > LARGEST_PX:
                    raise FormatError(f"a picture has {image.width} x {image.height} pixels", where=where)
                return np.array(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as e:
        raise FormatError(f"a picture is broken: {e}", where=where) from None
