"""Pictures from files, and several of them side by side in one."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.model.arrays import ByteArray, FloatArray

LARGEST_PX = 8192
"""Longest side of a picture, alone or of several side by side."""

_PLAIN_PX = 4  # side of a patch of one colour
_LEAST_PX = 64  # pictures are not made smaller than this to fit
_RIM_PX = 1  # about each picture, so that a colour between two pixels takes nothing from the next picture
_EDGE = 1e-4  # of a picture: so far beyond its edge is rounding, not the next repetition


def decode_picture(data: bytes, where: str) -> ByteArray:
    """Return the bytes of a PNG, JPEG or WebP file as sRGB, shape (H, W, 3).

    Raises:
        FormatError: it is none of them, broken, or too large.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is lower
            with Image.open(io.BytesIO(data), formats=("PNG", "JPEG", "WEBP")) as image:
                if max(image.size) > LARGEST_PX:
                    raise FormatError(f"a picture has {image.width} x {image.height} pixels", where=where)
                return np.array(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as e:
        raise FormatError(f"a picture is broken: {e}", where=where) from None


def plain_picture(color: ByteArray) -> ByteArray:
    """Return a small picture of one colour, sRGB, shape (3,)."""
    return np.tile(color, (_PLAIN_PX, _PLAIN_PX, 1))


def join_pictures(pictures: Sequence[ByteArray], places: Sequence[FloatArray]) -> tuple[ByteArray, FloatArray]:
    """Return the pictures of several parts as one, and the texture coordinates there.

    A picture that several parts share is taken once. One that repeats within a triangle is laid out as often as that
    triangle needs. What would be too large together is halved until it fits.

    Args:
        pictures: Of each part, sRGB, each of shape (H, W, 3); the same object where parts share one.
        places: Texture coordinates of each part's corners, v up, repeated beyond 0 to 1, each of shape (F, 3, 2).

    Returns:
        sRGB, shape (H, W, 3); texture coordinates of all corners, v up, shape (F, 3, 2).

    Raises:
        FormatError: pictures repeat too often within a triangle.
    """
    if all(picture is pictures[0] for picture in pictures):
        return pictures[0], np.concatenate(places)
    own = [place - np.floor(place.min(axis=1, keepdims=True) + _EDGE) for place in places]
    unique = {id(picture): picture for picture in pictures}
    tiles = {key: np.ones(2, int) for key in unique}
    for picture, place in zip(pictures, own, strict=True):
        reach = np.ceil(place.max(axis=(0, 1), initial=1.0) - _EDGE).clip(1, LARGEST_PX).astype(int)
        tiles[id(picture)] = np.maximum(tiles[id(picture)], reach)
    sizes = {key: tiles[key][::-1] * picture.shape[:2] + 2 * _RIM_PX for key, picture in unique.items()}
    corners, whole_size = _shelves(sizes)
    if max(whole_size) > LARGEST_PX:
        smaller = {key: _halved(picture) for key, picture in unique.items()}
        if all(smaller[key] is picture for key, picture in unique.items()):
            raise FormatError(f"pictures repeat too often: {whole_size[1]} x {whole_size[0]} pixels when laid out")
        return join_pictures([smaller[id(picture)] for picture in pictures], places)
    whole, moved = np.zeros((*whole_size, 3), np.uint8), []
    for key, picture in unique.items():
        (row, column), (tall, wide), (across, up) = corners[key], sizes[key], tiles[key]
        whole[row : row + tall, column : column + wide] = np.pad(
            np.tile(picture, (up, across, 1)), ((_RIM_PX, _RIM_PX), (_RIM_PX, _RIM_PX), (0, 0)), mode="wrap"
        )
    for picture, place in zip(pictures, own, strict=True):
        (row, column), (height, width) = corners[id(picture)], picture.shape[:2]
        bottom = row + sizes[id(picture)][0] - _RIM_PX
        u = (column + _RIM_PX + place[..., 0] * width) / whole_size[1]
        moved.append(np.stack([u, 1.0 - (bottom - place[..., 1] * height) / whole_size[0]], axis=-1))
    return whole, np.concatenate(moved)


def _shelves(sizes: dict[int, FloatArray]) -> tuple[dict[int, tuple[int, int]], tuple[int, int]]:
    """Place rectangles (height, width) in rows, the highest first; return their upper left corners, and the whole."""
    width = max(
        max(int(size[1]) for size in sizes.values()), int(np.sqrt(sum(float(np.prod(s)) for s in sizes.values())))
    )
    corners, row, column, tall = {}, 0, 0, 0
    for key in sorted(sizes, key=lambda key: -int(sizes[key][0])):
        height, wide = (int(side) for side in sizes[key])
        if column + wide > width:
            row, column, tall = row + tall, 0, 0
        corners[key] = row, column
        column, tall = column + wide, max(tall, height)
    return corners, (row + tall, width)


def _halved(picture: ByteArray) -> ByteArray:
    from PIL import Image

    if max(picture.shape[:2]) <= _LEAST_PX:
        return picture
    return np.array(Image.fromarray(picture).reduce(2))
