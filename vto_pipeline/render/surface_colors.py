"""The colour of surfaces at places of their triangles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.resample import bilinear_cell

_CLOTH = np.array([205, 206, 203], dtype=np.uint8)


class Paint(NamedTuple):
    """What is on the triangles of several meshes, numbered through.

    Args:
        corners: Where a triangle's corners are in its picture, v up, or else their colours, sRGB, shape (F, 3, 3).
        picture: Which picture is on it, -1 for none, shape (F,).
        places: Each picture's first pixel, its height and its width, shape (P, 3).
        pixels: Of all pictures, row by row, sRGB, shape (N, 3).
    """

    corners: FloatArray
    picture: IntArray
    places: IntArray
    pixels: ByteArray


def paint_of(meshes: Sequence[TriangleMesh]) -> Paint:
    """Return what is on meshes: their pictures, else their vertices' colours, else undyed cloth."""
    corners, picture, places, pixels = [], [], [np.zeros((0, 3), np.int32)], [np.zeros((0, 3), np.uint8)]
    for mesh in meshes:
        number = -1
        if mesh.skin is None:
            colors = np.broadcast_to(_CLOTH, mesh.vertices.shape) if mesh.colors is None else mesh.colors
            own = colors[mesh.faces].astype(np.float64)
        elif min(mesh.skin.picture.shape[:2]) < 2:  # a plain colour
            own = np.broadcast_to(mesh.skin.picture.reshape(-1, 3)[0].astype(np.float64), (len(mesh.faces), 3, 3))
        else:
            own = np.pad(mesh.skin.places, ((0, 0), (0, 0), (0, 1)))
            number = len(places) - 1
            places.append(np.array([[sum(map(len, pixels)), *mesh.skin.picture.shape[:2]]], np.int32))
            pixels.append(mesh.skin.picture.reshape(-1, 3))
        corners.append(own)
        picture.append(np.full(len(mesh.faces), number, np.int32))
    return Paint(np.vstack(corners), np.concatenate(picture), np.vstack(places), np.vstack(pixels))


@njit(cache=True, error_model="numpy")
def surface_color(paint, face, a, b, c):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return red, green and blue, sRGB 0 to 255, at a place on a triangle; a, b, c are its corners' shares."""
    corners, pixels, picture = paint.corners, paint.pixels, paint.picture[face]
    u = a * corners[face, 0, 0] + b * corners[face, 1, 0] + c * corners[face, 2, 0]
    v = a * corners[face, 0, 1] + b * corners[face, 1, 1] + c * corners[face, 2, 1]
    if picture < 0:
        return u, v, a * corners[face, 0, 2] + b * corners[face, 1, 2] + c * corners[face, 2, 2]
    first, height, width = paint.places[picture]
    u, v = u - np.ceil(u) + 1.0, v - np.ceil(v) + 1.0  # repeated beyond; 1 stays 1
    i, j, down, right = bilinear_cell(height, width, u * width - 0.5, (1.0 - v) * height - 0.5)
    upper, lower = first + i * width + j, first + (i + 1) * width + j
    return (
        _between(pixels, upper, lower, down, right, 0),
        _between(pixels, upper, lower, down, right, 1),
        _between(pixels, upper, lower, down, right, 2),
    )


@njit(cache=True)
def _between(pixels, upper, lower, down, right, channel):  # type: ignore[no-untyped-def]  # typed by Numba
    above = (1.0 - right) * pixels[upper, channel] + right * pixels[upper + 1, channel]
    below = (1.0 - right) * pixels[lower, channel] + right * pixels[lower + 1, channel]
    return (1.0 - down) * above + down * below
