"""Axis-aligned boxes: rows (low x, y, z, high x, y, z) of an array; in a kernel, tuples in registers."""

from __future__ import annotations

import numpy as np
from numba import njit

EMPTY = (np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf)
"""The box that overlaps none and adds nothing to another."""


@njit(cache=True, error_model="numpy")
def swept_boxes(start, end, radius):
    """Return the boxes that balls need on their straight path, shape (V, 6).

    Args:
        start, end: Centres [m], shape (V, 3).
        radius: [m], shape (V,). The box is exact without one, and up to rounding with one.
    """
    boxes = np.empty((len(start), 6))
    for i in range(len(start)):
        for d in range(3):
            boxes[i, d] = min(start[i, d], end[i, d]) - radius[i]
            boxes[i, d + 3] = max(start[i, d], end[i, d]) + radius[i]
    return boxes


@njit(cache=True, error_model="numpy")
def simplex_boxes(boxes, simplices):
    """Return the box about the boxes (V, 6) of the vertices of each simplex, shape (N, K): shape (N, 6)."""
    around = np.empty((len(simplices), 6))
    for i in range(len(simplices)):
        box = load_box(boxes, simplices[i, 0])
        for k in range(1, simplices.shape[1]):
            box = box_union(box, load_box(boxes, simplices[i, k]))
        store_box(around, i, box)
    return around


@njit(cache=True, error_model="numpy", forceinline=True)
def load_box(boxes, i):
    """Return row i."""
    return boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3], boxes[i, 4], boxes[i, 5]


@njit(cache=True, error_model="numpy", forceinline=True)
def store_box(boxes, i, a):
    """Write a into row i."""
    boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3], boxes[i, 4], boxes[i, 5] = a


@njit(cache=True, error_model="numpy", forceinline=True)
def box_union(a, b):
    """Return the box about both."""
    return (
        min(a[0], b[0]),
        min(a[1], b[1]),
        min(a[2], b[2]),
        max(a[3], b[3]),
        max(a[4], b[4]),
        max(a[5], b[5]),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def boxes_overlap(a, boxes, i):
    """Return whether the closed boxes a and row i have a point in common.

    Without branches: which of the six fails first is a coin toss, and a wrong guess costs more than all of them.
    """
    return (
        (a[0] <= boxes[i, 3])
        & (boxes[i, 0] <= a[3])
        & (a[1] <= boxes[i, 4])
        & (boxes[i, 1] <= a[4])
        & (a[2] <= boxes[i, 5])
        & (boxes[i, 2] <= a[5])
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def area(a):
    """Return half the surface [m²]."""
    x, y, z = a[3] - a[0], a[4] - a[1], a[5] - a[2]
    return x * y + y * z + z * x
