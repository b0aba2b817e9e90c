"""A garment from a field: its zero level, cut at the openings, in even triangles; and its waistband."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vto_pipeline.bench.samples.solids.clip import clip_snapped
from vto_pipeline.bench.samples.solids.surface_nets import Field, zero_surface
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.topology import component_areas, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

Cut = Callable[[FloatArray], FloatArray]
"""Positive where cloth is; points (N, 3) -> (N,)."""

_CELL = 0.012  # of the grid, where the garment's edges are no shorter [m]
_AROUND = 0.05  # searched about the box of a garment [m]


def mesh_garment_field(
    field: Field, low: FloatArray, high: FloatArray, cuts: Sequence[Cut], edge_mm: float
) -> TriangleMesh:
    """Return the largest piece of a field's zero level that all cuts leave.

    Args:
        field: Outside positive [m].
        low, high: Box that holds the garment [m], shape (3,).
        cuts: What opens it.
        edge_mm: Length of its edges [mm].

    Returns:
        One open sheet, normals outward [m].
    """

    def in_box(points: FloatArray) -> FloatArray:
        outside = np.maximum(low - 0.5 * _AROUND - points, points - high - 0.5 * _AROUND).max(axis=1)
        return np.maximum(field(points), outside)

    mesh = zero_surface(in_box, low - _AROUND, high + _AROUND, min(_CELL, 1e-3 * edge_mm))
    for cut in cuts:
        mesh = clip_snapped(mesh, cut(mesh.vertices))
    piece, area = component_areas(mesh)
    return remesh(submesh(mesh, piece == area.argmax())[0], RemeshConfig(edge_mm=edge_mm), Job())


def waistband(
    positions: FloatArray, top: float, axis_z: float, *, waist_reduction: float, width: float = 0.04
) -> FloatArray:
    """Return rest positions whose uppermost part is narrower than it is worn, as an elastic band is [m], shape (V, 3).

    Args:
        positions: As worn [m], shape (V, 3).
        top: Height of the upper edge [m].
        axis_z: Where the upright axis is [m].
        waist_reduction: By which share it is narrower.
        width: Height of the band, below which it fades out over the same height [m].
    """
    axis = np.array([0.0, 0.0, axis_z])
    share = np.clip((positions[:, 1] - (top - 2.0 * width)) / width, 0.0, 1.0)[:, None]
    return np.asarray(positions - waist_reduction * share * (positions - axis) * [1.0, 0.0, 1.0])
