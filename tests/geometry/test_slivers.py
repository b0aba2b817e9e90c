"""Slivers are flipped away, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.remeshing.slivers import flip_slivers
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
    flipped = flip_slivers(mesh)
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
    assert flip_slivers(mesh) is mesh
    tube = shapes.tube(30, 20)
    assert flip_slivers(tube) is tube


def least_angles(mesh: TriangleMesh) -> np.ndarray:
    """Angles by the law of cosines [degree]."""
    a, b, c = np.sort(np.linalg.norm(np.diff(mesh.vertices[mesh.faces][:, [0, 1, 2, 0]], axis=1), axis=2), axis=1).T
    return np.rad2deg(np.arccos(np.clip((b**2 + c**2 - a**2) / (2 * b * c), -1, 1)))


def pushed_to_rim(height: float) -> TriangleMesh:
    """A fan of triangles over seven vertices of a straight rim, its tip at some height [m] above the middle one."""
    rim = np.column_stack([0.01 * np.arange(7), np.zeros(7), np.zeros(7)])
    tip = [[0.032, height, 0.0]]
    row = np.column_stack([0.01 * np.arange(7), np.full(7, 0.01), np.zeros(7)])
    faces = [[k, k + 1, 7] for k in range(6)]
    faces += [[8 + k + 1, 8 + k, 7] for k in range(6)] + [[0, 7, 8], [7, 6, 14]]
    return TriangleMesh(np.vstack([rim, tip, row]), np.array(faces, np.int32))


@pytest.mark.parametrize("height", [1e-5, 1e-4])
def test_a_fan_of_slivers_along_a_rim_is_taken_down(height):
    mesh = pushed_to_rim(height)
    assert (least_angles(mesh) < 9).sum() >= 6
    flipped = flip_slivers(mesh)
    opposite_half_edges(flipped)  # manifold
    sharp = least_angles(flipped) < 9
    assert sharp.sum() <= 1  # between the tip and the rim: a vertex that close to it has one
    (rim,), (before,) = boundary_loops(flipped), boundary_loops(mesh)
    assert set(rim) == set(before)
    areas = face_area_vectors(flipped)
    assert_allclose(areas.sum(axis=0), face_area_vectors(mesh).sum(axis=0), rtol=1e-12)
    assert (areas[:, 2] > 0.0).all()


def test_no_flip_turns_a_triangle_over():
    corners = 0.01 * np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.9, 0.1, 0.0], [8.0, -1.0, 0.0]])
    mesh = TriangleMesh(corners, np.array([[0, 1, 2], [2, 1, 3]], np.int32))  # a dart: its other diagonal is outside
    assert least_angles(mesh).min() < 2
    assert flip_slivers(mesh) is mesh


def test_no_flip_makes_an_edge_that_is_there_already():
    thin = 0.01 * np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.01, 0.0], [1.0, -1.0, 0.0]])
    faces = [[0, 1, 2], [1, 0, 3], [3, 0, 2], [2, 1, 3]]  # a closed tetrahedron, all but flat: 2 and 3 are joined
    mesh = TriangleMesh(thin, np.array(faces, np.int32))
    opposite_half_edges(mesh)
    assert flip_slivers(mesh) is mesh
