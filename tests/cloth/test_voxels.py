"""A mesh as cubes: beside the shape it is of, and beside the winding number of each cube's centre."""

import igl
import numpy as np
import pytest
import trimesh

from vto_pipeline.cloth.placement.voxels import solid_cubes
from vto_pipeline.model.mesh import TriangleMesh

CUBE = 0.02  # m


def as_mesh(shape):
    return TriangleMesh(np.array(shape.vertices, np.float64), np.array(shape.faces, np.int32))


def centres(low, counts):
    return low + CUBE * (np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1) + 0.5)


def winding(mesh, low, counts):
    """Return how often the mesh winds around each centre, by the exact sum over its triangles."""
    points = centres(low, counts).reshape(-1, 3)
    return np.abs(igl.winding_number(mesh.vertices, mesh.faces.astype(np.int64), points)).reshape(counts)


@pytest.mark.parametrize("turned", [False, True])
def test_a_ball_is_those_whose_centre_is_nearer_than_its_radius(turned):
    ball = as_mesh(trimesh.creation.icosphere(4, 0.31))
    mesh = TriangleMesh(ball.vertices, ball.faces[:, ::-1].copy()) if turned else ball
    low = mesh.vertices.min(axis=0) - 0.013
    found = solid_cubes(mesh, low, CUBE)
    far = np.linalg.norm(centres(low, found.shape), axis=-1)
    sure = np.abs(far - 0.31) > 1e-3  # its triangles cut off less
    assert (found == (far < 0.31))[sure].all()


def test_rooms_within_shells_that_pass_through_each_other_are_told_apart():
    ring = trimesh.creation.torus(0.3, 0.08)
    bar = trimesh.creation.box((0.9, 0.05, 0.05))
    hollow = trimesh.creation.icosphere(3, 0.12)
    hollow.invert()
    around = trimesh.creation.icosphere(3, 0.17)
    mesh = as_mesh(trimesh.util.concatenate([ring, bar, around, hollow]))
    low = mesh.vertices.min(axis=0) - 0.007
    found = solid_cubes(mesh, low, CUBE)
    assert 0.0 < found.mean() < 0.5
    assert (found == (winding(mesh, low, found.shape) > 0.5)).all()


@pytest.mark.parametrize("turn", [1, -1])
def test_a_ray_through_an_edge_or_a_corner_meets_one_triangle_there(turn):
    """The diagonals of a box, and the middles of its sides, lie above centres of cubes."""
    box = trimesh.creation.box((9 * CUBE, 9 * CUBE, 5 * CUBE)).subdivide()
    mesh = TriangleMesh(box.vertices + np.array([4.5, 4.5, 2.5]) * CUBE, box.faces[:, ::turn].astype(np.int32))
    found = solid_cubes(mesh, np.zeros(3), CUBE)
    assert found.sum() == found[:9, :9, :5].sum() == 9 * 9 * 5


def test_what_is_open_is_solid_where_it_winds_around_more_than_half():
    ball = as_mesh(trimesh.creation.icosphere(4, 0.31))
    below = (ball.vertices[ball.faces, 1] < 0.1).all(axis=1)
    bowl = TriangleMesh(ball.vertices, ball.faces[below])
    low = bowl.vertices.min(axis=0) - 0.013
    found = solid_cubes(bowl, low, CUBE)
    assert 0.1 < found.mean() < 0.6
    around = winding(bowl, low, found.shape)
    sure = np.abs(around - 0.5) > 0.02  # the fast sum is not exact
    assert (found == (around > 0.5))[sure].all()
