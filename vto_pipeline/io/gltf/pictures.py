"""The pictures on the parts of a glTF scene, as one picture."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.formats.atlas import decode_picture, join_pictures, plain_picture
from vto_pipeline.io.gltf.document import GltfDocument, contained
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb

_DATA = ("data:image/png;base64,", "data:image/jpeg;base64,", "data:image/webp;base64,")
_LIMIT_BYTES = 200_000_000
_MOVED, _WEBP = "KHR_texture_transform", "EXT_texture_webp"


def base_factor(document: GltfDocument, primitive: Mapping[str, Any]) -> FloatArray:
    """Return the base colour that multiplies a part's picture and its vertices' colours, linear, shape (3,).

    Raises:
        FormatError: its material is broken.
    """
    try:
        surface = _material(document, primitive).get("pbrMetallicRoughness", {})
        factor = np.asarray(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), dtype=np.float64)
        return np.clip(np.nan_to_num(factor.reshape(4)[:3]), 0.0, 1.0)
    except (AttributeError, TypeError, ValueError) as e:
        raise FormatError(f"a material is broken: {e!r}", where=str(document.path)) from None


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
        FormatError: a picture is outside the file's folder, no PNG, JPEG or WebP, broken, or too large.
    """
    found: dict[Any, tuple[ByteArray, Mapping[str, Any] | None]] = {}
    moved = []
    try:
        for primitive, place in zip(primitives, places, strict=True):
            material = primitive.get("material")
            if material not in found:
                found[material] = _base_color(document, primitive)
            info = found[material][1]
            moved.append(place if info is None else _moved(place, info))
    except (AttributeError, KeyError, TypeError, ValueError) as e:
        raise FormatError(f"a material is broken: {e!r}", where=str(document.path)) from None
    if all(info is None for _, info in found.values()):
        return None
    return join_pictures([found[primitive.get("material")][0] for primitive in primitives], moved)


def _material(document: GltfDocument, primitive: Mapping[str, Any]) -> Mapping[str, Any]:
    material = primitive.get("material")
    return {} if material is None else document.item("materials", material)


def _base_color(document: GltfDocument, primitive: Mapping[str, Any]) -> tuple[ByteArray, Mapping[str, Any] | None]:
    """Return a material's base colour, sRGB, shape (H, W, 3), and how its picture lies; None where it is plain."""
    factor = base_factor(document, primitive)
    chosen = _material(document, primitive).get("pbrMetallicRoughness", {}).get("baseColorTexture")
    if chosen is None or chosen.get("extensions", {}).get(_MOVED, chosen).get("texCoord", chosen.get("texCoord", 0)):
        return plain_picture(encode_srgb(factor)), None
    texture = document.item("textures", chosen["index"])
    source = texture.get("extensions", {}).get(_WEBP, texture).get("source", texture.get("source"))
    picture = decode_picture(_bytes(document, document.item("images", source)), str(document.path))
    return (picture if (factor == 1.0).all() else encode_srgb(decode_srgb(picture) * factor)), chosen


def _moved(place: FloatArray, chosen: Mapping[str, Any]) -> FloatArray:
    """Return texture coordinates, v up, as KHR_texture_transform moves them: scaled, turned, shifted, with v down."""
    change = chosen.get("extensions", {}).get(_MOVED)
    if change is None:
        return place
    scale, shift = (
        np.asarray(change.get(key, both), np.float64) for key, both in (("scale", (1, 1)), ("offset", (0, 0)))
    )
    sine, cosine = np.sin(float(change.get("rotation", 0.0))), np.cos(float(change.get("rotation", 0.0)))
    down = (place * (1.0, -1.0) + (0.0, 1.0)) * scale
    turned = down @ np.array([[cosine, -sine], [sine, cosine]]) + shift
    if not np.isfinite(turned).all():
        raise ValueError("a texture is moved out of reach")
    return np.asarray(turned * (1.0, -1.0) + (0.0, 1.0))


def _bytes(document: GltfDocument, image: Mapping[str, Any]) -> bytes:
    if "bufferView" in image:
        return document.view(image["bufferView"])[0]
    uri = str(image.get("uri", ""))
    if not uri.startswith("data:"):
        beside = contained(uri, document.path)
        if not beside.is_file() or beside.stat().st_size > _LIMIT_BYTES:
            raise FormatError(f"the picture {uri[:80]!r} is not there, or too large", where=str(document.path))
        return beside.read_bytes()
    if not uri.startswith(_DATA):
        raise FormatError("a picture is not a PNG, JPEG or WebP", where=str(document.path))
    try:
        return b64decode(uri.partition(",")[2], validate=True)
    except ValueError:
        raise FormatError("a picture is not base64", where=str(document.path)) from None
