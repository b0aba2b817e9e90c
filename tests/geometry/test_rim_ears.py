"""Flat triangles at rims are flipped, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.geometry.remeshing.rim_ears import flip_ears
from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.topology import boundary_loops, face_area_vectors, opposite_half_edges
from vto_pipeline.model.mesh import TriangleMesh


def eared(height: float) -> TriangleMesh:
    """A plane of 10 mm triangles, with a triangle of some height [m] on one side of its rim."""
    x, y = np.meshgrid(np.arange(6), np.arange(5), indexing="ij")
    flat = np.column_stack([0.01 * x.ravel(), 0.01 * y.ravel(), np.zeros(x.size)])
    a = (5 * x[:-1, :-1] + y[:-1, :-1]).ravel()
    faces = np.vstack([np.column_stack([a, a + 5, a + 6]), np.column_stack([a, a + 6, a + 1])])
    tip = [0.025, -height, 0.0]
    return TriangleMesh(np.vstack([flat, tip]), np.vstack([faces, [10, len(flat), 15]]).astype(np.int32))


@pytest.mark.parametrize("height", [0.0, 1e-5, 1e-3])
def test_a_flat_ear_is_flipped_and_the_rim_stays(height):
    mesh = eared(height)
    flipped = flip_ears(mesh)
    opposite_half_edges(flipped)  # manifold
    assert_array_equal(flipped.vertices, mesh.vertices)
    (rim,), (before,) = boundary_loops(flipped), boundary_loops(mesh)
    assert set(rim) == set(before)
    assert_allclose(perimeter(flipped, rim), perimeter(mesh, before), rtol=1e-12)
    areas, were = face_area_vectors(flipped), face_area_vectors(mesh)
    assert_allclose(areas.sum(axis=0), were.sum(axis=0), rtol=1e-12)  # none is turned over
    assert (areas[:, 2] * np.sign(were[0, 2])).min() > 0.4 * np.median(np.abs(were[:, 2]))
    assert (flipped.faces != mesh.faces).any(axis=1).sum() == 2


def test_a_corner_that_is_as_good_as_its_neighbour_stays():
    mesh = eared(0.0087)
    assert flip_ears(mesh) is mesh
    tube = shapes.tube(30, 20)
    assert flip_ears(tube) is tube
