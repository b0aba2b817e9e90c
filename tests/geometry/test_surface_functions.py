"""Distances, cuts, samples and smooth functions against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.laplace import extend_smoothly, laplacian
from vto_pipeline.geometry.remeshing.clip import clip_to_positive
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, face_area_vectors, submesh
from vto_pipeline.model.mesh import TriangleMesh


def area(mesh):
    return np.linalg.norm(face_area_vectors(mesh), axis=1).sum()


def test_signed_distance_to_a_sphere_even_with_a_hole():
    ball = shapes.sphere(5)
    holed = submesh(ball, shapes.centers(ball)[:, 1] < 0.99)[0]
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.5, 1.5, (500, 3))
    points = points[points[:, 1] < 0.6]
    wanted = np.linalg.norm(points, axis=1) - 1.0
    for mesh in (ball, holed):
        found = SurfaceDistance(mesh).signed(points)
        assert_allclose(found.distance, wanted, atol=1.5e-3)  # sagitta of edges of 0.04 radii, and at the hole
        assert_allclose(np.linalg.norm(found.point - points, axis=1), np.abs(found.distance), atol=1e-12)
    assert (wanted < 0).sum() > 50


@pytest.mark.parametrize("above", [0.5, 0.9])
@pytest.mark.parametrize("open_by", [0.0, 0.3, 1.0])
def test_inside_is_what_the_exact_winding_number_says_near_and_far(open_by, above):
    """Against the sum of all solid angles (Jacobson et al. 2013), where that is not within 0.02 of the bound."""
    igl = pytest.importorskip("igl")
    ball = shapes.sphere(4)
    x, y, z = ball.vertices.T
    bumpy = TriangleMesh(
        ball.vertices * (1.0 + 0.3 * np.sin(7 * x) * np.sin(6 * y + 1) * np.sin(5 * z))[:, None], ball.faces
    )
    mesh = submesh(bumpy, shapes.centers(ball)[:, 1] < 1.0 - open_by)[0] if open_by else bumpy
    rng = np.random.default_rng(5)
    off = 10.0 ** rng.uniform(-3, 0, (4000, 1))  # in radii; the library computes in single precision
    points = mesh.vertices[rng.integers(0, len(mesh.vertices), 4000)] + off * rng.normal(size=(4000, 3))
    exact = igl.winding_number(mesh.vertices, mesh.faces.astype(np.int64), points)
    sure = np.abs(exact - above) > 0.02
    assert sure.sum() > 3000
    np.testing.assert_array_equal(SurfaceDistance(mesh).inside(points, above)[sure], exact[sure] > above)


def test_only_the_tree_that_is_asked_for_is_built_and_of_the_surface_as_it_was(monkeypatch):
    igl = pytest.importorskip("igl")
    ball, points = shapes.sphere(4), np.array([[0.0, 0.5, 0.0], [0.0, 2.0, 0.0]])
    vertices = ball.vertices.copy()
    one, other = (SurfaceDistance(TriangleMesh(vertices, ball.faces)) for _ in range(2))
    vertices *= 3.0
    with monkeypatch.context() as without:
        without.delattr(igl, "FastWindingNumberBVH")
        assert_allclose(one.nearest(points).distance, [0.5, 1.0], atol=6e-3)  # sagitta
    with monkeypatch.context() as without:
        without.delattr(igl, "AABB")
        assert other.inside(points).tolist() == [True, False]


@pytest.mark.parametrize("offset", [0.0, 0.1003, 0.25])
def test_a_cut_leaves_just_the_area_on_its_side(offset):
    sheet = shapes.grid(10, 10, 0.1)
    direction = np.array([0.6, 0.8, 0.0])
    values = sheet.vertices @ direction - 0.3 - offset
    part = clip_to_positive(sheet, values)
    missing = (0.3 + offset) ** 2 / (2.0 * 0.6 * 0.8)  # the triangle cut off a square's corner
    assert_allclose(area(part), 1.0 - missing, atol=0.15 * 0.1 * 0.6)  # snapping moves the line by 0.15 edges at most
    assert len(boundary_loops(part)) == 1
    assert_allclose((part.vertices @ direction - 0.3 - offset).min(), 0.0, atol=0.15 * 0.1 * 1.4)  # for the same reason


def test_a_cut_through_a_ball_is_a_circle_and_mixes_colours():
    ball = shapes.sphere(4)
    rising = np.rint(127.5 * (1.0 + ball.vertices)).astype(np.uint8)
    part = clip_to_positive(TriangleMesh(ball.vertices, ball.faces, rising), ball.vertices[:, 2] - 0.31)
    (loop,) = boundary_loops(part)
    assert_allclose(part.vertices[loop, 2], 0.31, atol=0.02)
    assert_allclose(part.colors[:, 2], 127.5 * (1.0 + part.vertices[:, 2]), atol=1.5)


def test_a_cut_that_leaves_nothing_is_refused():
    sheet = shapes.grid(2, 2)
    with pytest.raises(InputError, match="nothing"):
        clip_to_positive(sheet, -np.ones(9))


def test_samples_are_spread_by_area():
    pipe = shapes.tube(30, 20)
    squeezed = TriangleMesh(pipe.vertices * [1.0, 0.2, 1.0], pipe.faces)
    both = TriangleMesh(
        np.vstack([pipe.vertices, squeezed.vertices + 1.0]),
        np.vstack([pipe.faces, squeezed.faces + len(pipe.vertices)]),
    )
    points, normals, faces = sample_surface(both, 6000, seed=0)
    share = (faces >= len(pipe.faces)).mean()
    assert_allclose(share, area(squeezed) / area(both), atol=2e-3)  # stratified: within a point per face
    assert_allclose(SurfaceDistance(both).nearest(points).distance, 0.0, atol=1e-12)
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)


def test_laplacian_of_a_linear_function_vanishes_inside():
    sheet = shapes.grid(8, 8, 0.1)
    matrix, mass = laplacian(sheet)
    rim = np.unique(np.concatenate(boundary_loops(sheet)))
    inside = np.setdiff1d(np.arange(81), rim)
    # Right angles have cotangent zero and are kept at 0.05: alike on both sides of each edge, so still exact here.
    assert_allclose((matrix @ (sheet.vertices @ [2.0, -1.0, 0.0]))[inside], 0.0, atol=1e-12)
    assert_allclose(mass.sum(), 0.64, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_extension_of_a_linear_function_is_that_function(order):
    sheet = shapes.grid(8, 8, 0.1)
    free = np.abs(sheet.vertices[:, :2] - 0.4).max(axis=1) < 0.15
    values = sheet.vertices @ np.array([[1.0], [2.0], [0.0]])
    blanked = np.where(free[:, None], 99.0, values)
    assert_allclose(extend_smoothly(sheet, blanked, free, order), values, atol=1e-9)


def test_a_held_border_bears_no_moment():
    """As a beam: clamped at one end with a slope, hinged at the other; along a tube nothing depends on the turn."""
    turn, along = np.meshgrid(np.arange(24) * np.pi / 12, np.arange(43) / 40 - 0.05, indexing="ij")
    vertices = np.stack([np.cos(turn) / 6.6, along, np.sin(turn) / 6.6], axis=-1).reshape(-1, 3)
    at = np.arange(24 * 43).reshape(24, 43)
    a, b, c, d = at[:, :-1], np.roll(at, -1, 0)[:, :-1], np.roll(at, -1, 0)[:, 1:], at[:, 1:]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3).astype(np.int32)
    y = vertices[:, 1:2]
    beam = np.where(y < 0, y, y - 1.5 * y**2 + 0.5 * y**3)  # slope 1 at 0; height and bending 0 at 1
    free = (y[:, 0] > 1e-9) & (y[:, 0] < 1 - 1e-9)
    found = extend_smoothly(TriangleMesh(vertices, faces), np.where(free[:, None], 9.0, beam), free, 2)
    assert_allclose(found, beam, atol=0.01)


def test_paths_along_edges_are_as_long_as_the_grid_says():
    sheet = shapes.grid(10, 10, 0.1)
    found = distance_from(sheet, np.array([0]), limit=0.55)
    along = np.arange(6) * 11  # vertices along the first column
    assert_allclose(found[along], 0.1 * np.arange(6), atol=1e-12)
    assert np.isinf(found[-1])
