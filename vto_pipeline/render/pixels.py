"""The pixels of a picture, a band of rows at a time, so that what is at work stays in the cache."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.rasterise import draw_rows
from vto_pipeline.numerics.resample import bilinear
from vto_pipeline.render.shading import crevice, matt_brightness
from vto_pipeline.render.shadows import lit_share
from vto_pipeline.render.surface_colors import surface_color

SAMPLES = 2
"""Per pixel and direction."""

_BAND = 16  # rows of pixels
_PAPER = 255.0
_SHADE = 0.35  # what the ground loses where the light does not reach it


class View(NamedTuple):
    """Triangles as a picture shows them; the viewer's frame has right, up and towards the viewer.

    Args:
        corners: In samples of the picture, depth last, shape (F, 3, 3).
        normals: Of the corners, in the viewer's frame, of any length, shape (F, 3, 3).
        to_image: Samples per metre along the viewer's axes, shape (3,).
        middle: Where the viewer's frame begins in the picture [samples], shape (3,).
        around: Depth about each `step`-th sample, as of `surroundings`.
        step: See `around`.
        up: The upright, in the viewer's frame, shape (3,).
        level: How high the ground is along it [m].
        far: So far before and behind the frame's middle the ground reaches [m].
    """

    corners: FloatArray
    normals: FloatArray
    to_image: FloatArray
    middle: FloatArray
    around: FloatArray
    step: int
    up: FloatArray
    level: float
    far: float


@njit(cache=True, error_model="numpy", parallel=True)
def draw_pixels(view, paint, shadow, width, height):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return a picture, sRGB on white, shape (height, width, 3).

    Args:
        view: The triangles as they are seen.
        paint: What is on them.
        shadow: What the key light sees, in the viewer's frame; where it sees nothing there is no ground either.
        width, height: Of the picture [px].
    """
    picture = np.empty((height, width, 3), np.uint8)
    count = (height + _BAND - 1) // _BAND
    for k in prange(count):
        _draw_band(view, paint, shadow, k * _BAND, picture[k * _BAND : (k + 1) * _BAND])
    return picture


@njit(cache=True, error_model="numpy")
def _draw_band(view, paint, shadow, first, picture):  # type: ignore[no-untyped-def]  # typed by Numba
    rows, width = picture.shape[:2]
    face = np.full((SAMPLES * rows, SAMPLES * width), -1, np.int32)
    weight = np.empty((*face.shape, 2))
    depth = np.full(face.shape, np.inf)
    draw_rows(view.corners, SAMPLES * first, face, weight, depth)
    for i in range(rows):
        for j in range(width):
            red = green = blue = 0.0
            for row in range(SAMPLES * i, SAMPLES * (i + 1)):
                for column in range(SAMPLES * j, SAMPLES * (j + 1)):
                    x, y = float(column), float(row + SAMPLES * first)
                    if face[row, column] < 0:
                        r = g = b = _ground(view, shadow, x, y)
                    else:
                        v, w = weight[row, column]
                        r, g, b = _surface(view, paint, shadow, face[row, column], v, w, x, y, depth[row, column])
                    red, green, blue = red + r, green + g, blue + b
            picture[i, j, 0] = np.round(red / SAMPLES**2)
            picture[i, j, 1] = np.round(green / SAMPLES**2)
            picture[i, j, 2] = np.round(blue / SAMPLES**2)


@njit(cache=True, error_model="numpy")
def _surface(view, paint, shadow, face, v, w, x, y, depth):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return the colour of a sample that shows a triangle."""
    a, corners, normals = 1.0 - (v + w), view.corners, view.normals
    normal_x = a * normals[face, 0, 0] + v * normals[face, 1, 0] + w * normals[face, 2, 0]
    normal_y = a * normals[face, 0, 1] + v * normals[face, 1, 1] + w * normals[face, 2, 1]
    normal_z = a * normals[face, 0, 2] + v * normals[face, 1, 2] + w * normals[face, 2, 2]
    right, high, towards = _place(view, x, y, depth)
    lit = lit_share(shadow, right, high, towards, normal_x, normal_y, normal_z)
    first_x, first_y = corners[face, 1, 0] - corners[face, 0, 0], corners[face, 1, 1] - corners[face, 0, 1]
    second_x, second_y = corners[face, 2, 0] - corners[face, 0, 0], corners[face, 2, 1] - corners[face, 0, 1]
    far_side = first_x * second_y - first_y * second_x > 0.0  # rows run down, so outer sides run clockwise
    around = bilinear(view.around, x / view.step, y / view.step, 0)
    brightness = matt_brightness(normal_x, normal_y, normal_z, far_side, lit)
    brightness *= crevice((around - depth) / view.to_image[2])
    red, green, blue = surface_color(paint, face, a, v, w)
    return red * brightness, green * brightness, blue * brightness


@njit(cache=True, error_model="numpy")
def _ground(view, shadow, x, y):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return the brightness of a sample that shows no triangle: of paper, or of the ground on it in shadow."""
    up = view.up
    if len(shadow.depth) == 0 or up[2] <= 0.0:  # from below, or along it, no ground is seen
        return _PAPER
    right, high, _ = _place(view, x, y, 0.0)
    towards = (view.level - right * up[0] - high * up[1]) / up[2]
    if abs(towards) >= view.far:
        return _PAPER
    return _PAPER * (1.0 - _SHADE * (1.0 - lit_share(shadow, right, high, towards, up[0], up[1], up[2])))


@njit(cache=True, error_model="numpy")
def _place(view, x, y, depth):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return a place of the picture in the viewer's frame [m]."""
    middle, to_image = view.middle, view.to_image
    return (x - middle[0]) / to_image[0], (y - middle[1]) / to_image[1], (depth - middle[2]) / to_image[2]
