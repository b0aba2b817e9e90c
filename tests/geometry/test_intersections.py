"""Triangle intersections against hand cases, ipctk and brute force in rationals."""

from __future__ import annotations

from itertools import combinations

import ipctk
import numpy as np
import pytest
import shapes
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline.geometry.intersections import intersecting_faces, segment_meets_triangle, self_intersections
from vto_pipeline.model.mesh import TriangleMesh


def judge(vertices, faces):
    """What ipctk says of the whole mesh."""
    faces = np.array(faces)
    return ipctk.has_intersections(
        ipctk.CollisionMesh(np.array(vertices), ipctk.edges(faces), faces), np.array(vertices)
    )


FLOOR = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
CASES = {
    "pierced in the middle": ([[1, 1, -1], [1, 1, 1], [2, 1, 2]], True),
    "beside": ([[5, 5, -1], [5, 5, 1], [6, 5, 2]], False),
    "above": ([[1, 1, 1e-12], [2, 1, 1], [1, 2, 1]], False),
    "touching with a corner": ([[1, 1, 0], [2, 1, 1], [1, 2, 1]], True),
    "touching at a corner": ([[0, 0, 0], [-1, -1, 1], [-1, 0, 1]], True),
    "coplanar, inside": ([[1, 1, 0], [1.5, 1, 0], [1, 1.5, 0]], True),
    "coplanar, containing": ([[-9, -9, 0], [30, -9, 0], [-9, 30, 0]], True),
    "coplanar, crossing": ([[-1, 1, 0], [5, 1, 0], [5, 1.5, 0]], True),
    "coplanar, apart": ([[5, 5, 0], [6, 5, 0], [5, 6, 0]], False),
    "crossing the plane outside": ([[3, 3, -1], [3, 3, 1], [4, 4, 1]], False),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("turn", range(3))
def test_two_triangles_by_hand(case, turn):
    other, meet = CASES[case]
    other = np.roll(np.array(other, float), turn, axis=0)
    one, two = TriangleMesh(FLOOR, [[0, 1, 2]]), TriangleMesh(other, [[0, 1, 2]])
    assert len(intersecting_faces(one, two)) == meet
    assert len(intersecting_faces(two, one)) == meet
    soup = TriangleMesh(np.vstack([FLOOR, other]), [[0, 1, 2], [3, 4, 5]])
    assert len(self_intersections(soup)) == meet


def test_random_soup_is_that_of_all_pairs_tested_one_by_one():
    rng = np.random.default_rng(0)
    vertices = (rng.random((120, 1, 3)) + 0.15 * rng.normal(size=(120, 3, 3))).reshape(-1, 3)
    faces = np.arange(360).reshape(-1, 3)

    def meet(f, g):
        edges = [(h[k], h[(k + 1) % 3], o) for h, o in ((f, g), (g, f)) for k in range(3)]
        return any(segment_meets_triangle(vertices[p], vertices[q], *vertices[o]) for p, q, o in edges)

    wanted = [(i, j) for i, j in combinations(range(120), 2) if meet(faces[i], faces[j])]
    assert 50 < len(wanted) < 2000
    assert_array_equal(self_intersections(TriangleMesh(vertices, faces)), wanted)


@pytest.mark.parametrize("seed", range(20))
def test_whether_two_balls_meet_as_ipctk_says(seed):
    rng = np.random.default_rng(seed)
    ball = shapes.sphere(2)
    turned = Rotation.random(random_state=seed).apply(ball.vertices.copy())
    direction = rng.normal(size=3)
    away = 2.0 * (1.0 + rng.uniform(-0.03, 0.01)) * direction / np.linalg.norm(direction)
    other = TriangleMesh(turned + away, ball.faces)
    vertices = np.vstack([ball.vertices, other.vertices])
    faces = np.vstack([ball.faces, other.faces + len(ball.vertices)])
    pairs = intersecting_faces(ball, other)
    assert (len(pairs) > 0) == judge(vertices, faces)
    both = self_intersections(TriangleMesh(vertices, faces))
    assert_array_equal(both - [0, len(ball.faces)], pairs)


def test_balls_far_into_each_other_meet_along_a_circle():
    ball = shapes.sphere(3)
    pairs = intersecting_faces(ball, TriangleMesh(ball.vertices + np.array([0.7, 0.2, 0.1]), ball.faces))
    assert 50 < len(pairs) < 400


def test_faces_that_share_a_vertex_may_still_pass_through_each_other():
    vertices = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 0.3, -1], [1, 0.4, 1]]
    assert_array_equal(self_intersections(TriangleMesh(vertices, [[0, 1, 2], [0, 3, 4]])), [[0, 1]])


@pytest.mark.parametrize("angles", [(0, 0, 0), (0.3, 0.5, 0.7)])
def test_a_flat_sheet_does_not_meet_itself(angles):
    sheet = shapes.grid(25, 25, 0.01)
    turned = TriangleMesh(Rotation.from_euler("xyz", angles).apply(sheet.vertices.copy()), sheet.faces)
    assert len(self_intersections(turned)) == 0
    assert not judge(turned.vertices, turned.faces)
