"""Sheets for the scenes of self-contact: squares, stacks, a folded towel; and the funnel."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid

from vto_pipeline.bench.cloth.scenes import grid
from vto_pipeline.cloth.swatch.meshes import strip
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_TURN = 0.12  # rad: each sheet of a stack lies a little turned on the one below, so that no edges coincide
_FUNNEL = ((0.06, -0.12), (0.06, 0.0), (0.20, 0.10), (0.21, 0.10), (0.07, -0.005), (0.07, -0.12))
"""Its cut, radius and height [m]: a throat of 12 cm, and walls of 10 mm."""


def square(count: int, side: float, width: float | None = None) -> tuple[FloatArray, IntArray]:
    """Return a level sheet about the origin, facing up, N x N vertices; sides along x and z [m]."""
    across, along, faces = grid(count)
    flat = np.column_stack([side * (across - 0.5), np.zeros(len(along)), (width or side) * (0.5 - along)])
    return flat, faces


def stacked(layers: int, sheet: tuple[FloatArray, IntArray], gap: float) -> tuple[FloatArray, IntArray]:
    """Return this many sheets over each other, the lowest half a gap [m] above y = 0."""
    flat, faces = sheet
    points = []
    for k in range(layers):
        turn = _TURN * k
        x, y, z = flat.T
        points.append(
            np.column_stack(
                [x * np.cos(turn) + z * np.sin(turn), y + gap * (k + 0.5), z * np.cos(turn) - x * np.sin(turn)]
            )
        )
    return np.vstack(points), np.vstack([faces + len(flat) * k for k in range(layers)]).astype(np.int32)


def folded_twice(count: int, length: float, width: float, gap: float) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return a towel folded in four, above y = 0, and the same towel flat.

    Folded in the middle, and both layers in the middle again, along the same direction: straights and half circles,
    so that nothing is stretched.

    Args:
        count: Vertices along its length, in the flat; as close to each other across.
        length, width: Of the flat towel [m].
        gap: Between layers [m].

    Returns:
        Start and flat positions [m], shape (V, 3); faces, shape (F, 3).
    """
    points, faces = strip("grid", 0.0, length, width, length / (count - 1))
    flat = np.column_stack([points[:, 0], np.zeros(len(points)), -points[:, 1]])
    inner, outer = 0.5 * np.pi * gap, 1.5 * np.pi * gap
    straight = (length - 2.0 * inner - outer) / 4.0
    ends = np.cumsum([0.0, straight, outer, straight, inner, straight, inner, straight])
    arc = np.linspace(0.0, length, 10001)
    heading = np.interp(arc, ends, np.pi * np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 1.0, 1.0]))
    curve = cumulative_trapezoid(np.exp(1j * heading), arc, initial=0.0)
    x, y = (np.interp(flat[:, 0], arc, part) for part in (curve.real, curve.imag))
    return np.column_stack([x, y + 0.5 * gap, flat[:, 2]]), flat, faces


def funnel(around: int = 48) -> TriangleMesh:
    """Return a funnel about the y axis: a closed solid of revolution, normals outward."""
    angle = 2.0 * np.pi * np.arange(around) / around
    rings = [np.column_stack([r * np.cos(angle), np.full(around, y), r * np.sin(angle)]) for r, y in _FUNNEL]
    i, j = np.arange(around), (np.arange(around) + 1) % around
    faces = []
    for k in range(len(_FUNNEL)):
        low, high = around * k, around * ((k + 1) % len(_FUNNEL))
        faces += [np.column_stack([low + i, low + j, high + i]), np.column_stack([low + j, high + j, high + i])]
    return TriangleMesh(np.vstack(rings), np.vstack(faces).astype(np.int32))
