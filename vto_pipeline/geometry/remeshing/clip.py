"""Cut a surface along the line where a value changes sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import half_edges, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

SNAP = 0.15
"""A line that crosses an edge nearer than this share of its length to one end goes through that end."""


def clip_to_positive(mesh: TriangleMesh, values: FloatArray) -> TriangleMesh:
    """Return the part of the surface where a value, linear on faces, is positive.

    Args:
        mesh: The surface; colours are carried along.
        values: On vertices, shape (V,).

    Raises:
        InputError: the value is positive nowhere.
    """
    values = _snapped(mesh, values)
    above = values > 0.0
    if not above.any():
        raise InputError("the cut leaves nothing of the surface")
    halves = half_edges(mesh).astype(np.int64)
    low, high = halves.min(axis=1), halves.max(axis=1)
    crossing = values[low] * values[high] < 0.0
    key, of_half = np.unique((low * len(above) + high)[crossing], return_inverse=True)
    start, end = np.divmod(key, len(above))
    share = (values[start] / (values[start] - values[end]))[:, None]
    middle = np.full(len(halves), -1, dtype=np.int64)
    middle[crossing] = len(above) + of_half
    vertices = np.vstack([mesh.vertices, (1.0 - share) * mesh.vertices[start] + share * mesh.vertices[end]])
    colors = mesh.colors
    if colors is not None:
        mixed = (1.0 - share) * colors[start] + share * colors[end]
        colors = np.vstack([colors, np.rint(mixed).astype(np.uint8)])
    faces = _positive_parts(mesh.faces.astype(np.int64), values, middle.reshape(-1, 3))
    return submesh(TriangleMesh(vertices, faces.astype(np.int32), colors), np.ones(len(faces), dtype=bool))[0]


def _snapped(mesh: TriangleMesh, values: FloatArray) -> FloatArray:
    """Return the values with zero at vertices that the line almost passes through, to avoid slivers."""
    start, end = half_edges(mesh).T
    crossing = values[start] * values[end] < 0.0
    start, end = start[crossing], end[crossing]
    near = np.abs(values[start]) < SNAP * np.abs(values[start] - values[end])
    snapped = values.copy()
    snapped[start[near]] = 0.0
    return snapped


def _positive_parts(faces: NDArray[np.int64], values: FloatArray, middle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles of the positive part of each face; middle: the vertex on each crossed edge, or -1."""
    sign = np.sign(values[faces]).astype(int)
    ups, downs = (sign > 0).sum(axis=1), (sign < 0).sum(axis=1)
    # Turn each face so that its only positive corner, or of two positive its negative one, comes first.
    first = np.where(ups == 1, np.argmax(sign, axis=1), np.argmin(sign, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, _, ca = np.take_along_axis(middle, turn, axis=1).T
    one = (ups == 1) & (downs > 0)
    two = (ups == 2) & (downs == 1)
    to_b, to_c = np.where(ab >= 0, ab, b), np.where(ca >= 0, ca, c)
    return np.vstack(
        [
            faces[(ups > 0) & (downs == 0)],
            np.column_stack([a, to_b, to_c])[one],
            np.column_stack([ab, b, c])[two],
            np.column_stack([ab, c, ca])[two],
        ]
    )
