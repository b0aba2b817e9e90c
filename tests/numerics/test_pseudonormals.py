"""The sign of a distance, against winding numbers."""

from itertools import pairwise

import igl
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.numerics.spatial.pseudonormals import feature_normal, pseudonormals


def signs(vertices, faces, points):
    normals = pseudonormals(vertices, faces)
    tree = bvh.build(vertices, faces)
    triangle, weights, feature = bvh.closest_triangles(tree, vertices, faces, points, np.full(len(points), np.inf))
    found = np.einsum("nk,nkj->nj", weights, vertices[faces[triangle]])
    normal = np.array([feature_normal(normals, faces, t, f) for t, f in zip(triangle, feature, strict=True)])
    return np.sign(np.einsum("nj,nj->n", points - found, normal)), feature


@pytest.mark.parametrize("shape", ["torus", "spikes"])
def test_inside_and_outside(shape):
    mesh = trimesh.creation.torus(1.0, 0.4, 12, 8) if shape == "torus" else trimesh.creation.icosphere(1)
    vertices = np.array(mesh.vertices)
    if shape == "spikes":  # sharp vertices, where face normals alone give the wrong sign
        vertices *= np.where(np.arange(len(vertices)) % 3 == 0, 2.5, 0.7)[:, None]
    faces = np.array(mesh.faces, np.int32)
    points = np.random.default_rng(0).uniform(-2.6, 2.6, (20000, 3))
    found, feature = signs(vertices, faces, points)
    inside = igl.winding_number(vertices, faces.astype(np.int64), points) > 0.5
    assert_array_equal(found < 0, inside)
    assert 100 < inside.sum() < 10000
    assert (feature < 3).sum() > 50  # vertices were tried


def test_there_is_no_inside_over_a_rim():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    normals = pseudonormals(vertices, np.array([[0, 1, 2]], np.int32))
    assert_array_equal(normals.vertices, 0.0)
    assert_array_equal(normals.edges, 0.0)
    assert_allclose(normals.faces, [[0, 0, 1]], rtol=0, atol=1e-15)  # by the right-hand rule


def test_cutting_a_face_in_slivers_does_not_turn_the_normal_of_its_corner():
    """What the weights by angle are for: the surface is the same, so its vertex normal must be."""
    apex, rim = [0.0, 1.0, 0.0], [[1, 0, 0], [0, 0, -1], [-1, 0, 0.5]]
    whole = np.array([apex, *rim], dtype=np.float64)
    plain = pseudonormals(whole, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [3, 2, 1]], np.int32))
    along = np.linspace(0, 1, 12)[1:-1, None]
    extra = (1 - along) * whole[1] + along * whole[2]
    chain = [1, *range(4, 14), 2]
    slivers = [[0, a, b] for a, b in pairwise(chain)]
    floor = [[3, b, a] for a, b in pairwise(chain)]
    cut = pseudonormals(np.vstack([whole, extra]), np.array([*slivers, [0, 2, 3], [0, 3, 1], *floor], np.int32))
    assert_allclose(cut.vertices[0], plain.vertices[0], rtol=0, atol=1e-12)  # rounding of the angles
