"""Projection into a picture and rasterisation: the visible triangle of each pixel."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def rasterise(
    corners: NDArray[np.float64], width: int, height: int
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Draw triangles into a depth buffer. Where two are equally near, the first stays.

    A pixel belongs to a triangle when its centre is inside (edge functions, Pineda 1988).

    Args:
        corners: Pixel column, pixel row and depth of each triangle's corners, shape (F, 3, 3). Smaller depth is nearer.
        width, height: Size of the picture [px].

    Returns:
        The triangle of each pixel, -1 for none, shape (height, width); its weights at the second and third corner,
        shape (height, width, 2); the depth, infinite for none, shape (height, width).
    """
    face = np.full((height, width), -1, np.int32)
    weight = np.zeros((height, width, 2))
    depth = np.full((height, width), np.inf)
    draw_rows(corners, 0, face, weight, depth)
    return face, weight, depth


@njit(cache=True, nogil=True)
def projected(vertices, cam_from_mesh, lens, nearest):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return pixel column, pixel row and depth of each vertex, as `rasterise_depth` takes them, shape (V, 3).

    Args:
        vertices: Of a mesh, shape (V, 3).
        cam_from_mesh: A similarity, shape (4, 4).
        lens: Focal lengths and principal point (fx, fy, cx, cy) [px].
        nearest: What is no farther ahead than this is not before the camera: zeros.
    """
    fx, fy, cx, cy = lens
    pixel = np.zeros((len(vertices), 3))
    local = np.empty(3)
    for n in range(len(vertices)):
        for i in range(3):
            local[i] = cam_from_mesh[i, 3]
            for j in range(3):
                local[i] += cam_from_mesh[i, j] * vertices[n, j]
        z = local[2]
        if z > nearest:
            pixel[n, 0], pixel[n, 1], pixel[n, 2] = fx * local[0] / z + cx, fy * local[1] / z + cy, z
    return pixel


@njit(cache=True, nogil=True)
def rasterise_depth(points, faces, width, height):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return the depth alone, as of `rasterise`, of a mesh's triangles that are whole before the camera.

    Args:
        points: Pixel column, pixel row and depth of each vertex, shape (V, 3).
        faces: Vertices of each triangle, shape (F, 3); one with a corner whose depth is not positive is left out.
        width, height: Size of the picture [px].
    """
    depth = np.full((height, width), np.inf)
    for f in range(len(faces)):
        ax, ay, az = points[faces[f, 0]]
        bx, by, bz = points[faces[f, 1]]
        cx, cy, cz = points[faces[f, 2]]
        if not (az > 0.0 and bz > 0.0 and cz > 0.0):
            continue
        begin, end = _covered(ay, by, cy, 0, height)
        if begin >= end:
            continue
        left, right = _covered(ax, bx, cx, 0, width)
        for row in range(begin, end):
            for col in range(left, right):
                v, w = _weights(col, row, ax, ay, bx, by, cx, cy)
                if v >= 0.0:
                    z = az + v * (bz - az) + w * (cz - az)
                    if z < depth[row, col]:
                        depth[row, col] = z
    return depth


@njit(cache=True, nogil=True)
def draw_rows(corners, first, face, weight, depth):  # type: ignore[no-untyped-def]  # typed by Numba
    """Draw triangles into some rows of a depth buffer, from row `first` on; the rest is as of `rasterise`."""
    rows, width = face.shape
    for f in range(len(corners)):
        ay, by, cy = corners[f, 0, 1], corners[f, 1, 1], corners[f, 2, 1]
        begin, end = _covered(ay, by, cy, first, first + rows)
        if begin >= end:
            continue
        ax, bx, cx = corners[f, 0, 0], corners[f, 1, 0], corners[f, 2, 0]
        az, bz, cz = corners[f, 0, 2], corners[f, 1, 2], corners[f, 2, 2]
        left, right = _covered(ax, bx, cx, 0, width)
        for row in range(begin, end):
            for col in range(left, right):
                v, w = _weights(col, row, ax, ay, bx, by, cx, cy)
                if v < 0.0:
                    continue
                z = az + v * (bz - az) + w * (cz - az)
                if z < depth[row - first, col]:
                    depth[row - first, col] = z
                    face[row - first, col] = f
                    weight[row - first, col, 0] = v
                    weight[row - first, col, 1] = w


@njit(cache=True, nogil=True)
def _covered(a, b, c, first, end):  # type: ignore[no-untyped-def]  # typed by Numba
    """First pixel centre between the least and the largest of three places, within limits, and the end of them."""
    return max(first, int(np.ceil(min(a, b, c)))), min(end, int(np.floor(max(a, b, c))) + 1)


@njit(cache=True, nogil=True)
def _weights(col, row, ax, ay, bx, by, cx, cy):  # type: ignore[no-untyped-def]  # typed by Numba
    """Weights of a pixel's centre at the second and third corner of a triangle; both -1 outside."""
    twice_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    second = (col - ax) * (cy - ay) - (cx - ax) * (row - ay)
    third = (bx - ax) * (row - ay) - (col - ax) * (by - ay)
    if twice_area < 0.0:
        twice_area, second, third = -twice_area, -second, -third
    if twice_area == 0.0 or second < 0.0 or third < 0.0:  # most pixels, without a division
        return -1.0, -1.0
    v, w = second / twice_area, third / twice_area
    if v + w > 1.0:
        return -1.0, -1.0
    return v, w
