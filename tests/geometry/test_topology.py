"""Topology against brute force and closed shapes."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import InputError
from vto_pipeline.geometry import topology
from vto_pipeline.model.mesh import TriangleMesh


def test_edges_are_those_of_a_python_set():
    mesh = shapes.grid(5, 4)
    wanted = sorted({tuple(sorted((f[k], f[(k + 1) % 3]))) for f in mesh.faces.tolist() for k in range(3)})
    assert_array_equal(topology.edges(mesh), wanted)


def test_each_edge_knows_the_faces_that_hold_it():
    mesh = shapes.grid(3, 3)
    for edge, faces in zip(topology.edges(mesh), topology.edge_faces(mesh), strict=True):
        holding = [f for f in range(len(mesh.faces)) if set(edge) <= set(mesh.faces[f])]
        assert sorted(faces[faces >= 0]) == holding


def test_euler_characteristic_of_a_sphere_and_a_tube():
    ball, pipe = shapes.sphere(3), shapes.tube(20, 6)
    for mesh, wanted in ((ball, 2), (pipe, 0)):
        assert len(mesh.vertices) - len(topology.edges(mesh)) + len(mesh.faces) == wanted


def test_a_sheet_with_a_hole_has_two_loops_that_run_as_their_faces_do():
    sheet = shapes.grid(6, 6)
    middle = np.abs(shapes.centers(sheet)[:, :2] - 3.0).max(axis=1) < 1.0
    loops = topology.boundary_loops(shapes.without(sheet, middle))
    assert sorted(len(loop) for loop in loops) == [8, 24]
    for loop in loops:
        p = sheet.vertices[loop, :2]
        area = 0.5 * np.sum(p[:, 0] * np.roll(p[:, 1], -1) - p[:, 1] * np.roll(p[:, 0], -1))
        assert area == (36.0 if len(loop) == 24 else -4.0)  # outer anticlockwise, hole clockwise


def test_loops_that_touch_in_a_vertex_stay_apart():
    mesh = TriangleMesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]]
    )  # two triangles that share only vertex 0
    loops = [sorted(loop.tolist()) for loop in topology.boundary_loops(mesh)]
    assert loops == [[0, 1, 2], [0, 3, 4]]


def test_a_closed_surface_has_no_loop():
    assert topology.boundary_loops(shapes.sphere(2)) == []


def test_hinges_hold_two_well_oriented_faces():
    mesh = shapes.sphere(1)
    faces = {tuple(np.roll(f, -int(np.argmin(f)))) for f in mesh.faces}
    found = topology.hinges(mesh)
    assert len(found) == len(topology.edges(mesh))
    for v0, v1, a, b in found.tolist():
        for face in ((v0, v1, a), (v1, v0, b)):
            assert tuple(np.roll(face, -int(np.argmin(face)))) in faces


def test_vertex_normals_of_a_sphere_are_its_radii():
    ball = shapes.sphere(4, radius=0.3)
    assert_allclose(topology.vertex_normals(ball), ball.vertices / 0.3, atol=3e-3)  # O(edge²), edges of 0.07 radii


def test_vertex_normals_do_not_depend_on_how_a_corner_is_triangulated():
    box = TriangleMesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1]],
        [[0, 2, 1], [0, 3, 2], [0, 1, 5], [0, 5, 4], [0, 4, 3]],
    )
    assert_allclose(topology.vertex_normals(box)[0], -np.ones(3) / np.sqrt(3.0), atol=1e-12)  # three right angles


def test_submesh_keeps_places_and_colours():
    ball = shapes.sphere(2)
    colors = np.arange(3 * len(ball.vertices)).reshape(-1, 3) % 256
    mesh = TriangleMesh(ball.vertices, ball.faces, colors.astype(np.uint8))
    keep = shapes.centers(mesh)[:, 1] > 0.0
    part, source = topology.submesh(mesh, keep)
    assert_array_equal(part.vertices[part.faces], mesh.vertices[mesh.faces[keep]])
    assert_array_equal(part.colors, mesh.colors[source])


def test_pieces_that_share_only_a_vertex_are_two():
    mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]])
    assert topology.face_components(mesh)[0] == 2


def test_areas_are_those_of_boxes_and_they_follow_the_scale():
    vertices = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 5.0)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = TriangleMesh(vertices, [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])
    assert topology.surface_area(box) == 2.0 * (2 * 3 + 3 * 5 + 2 * 5)
    assert sorted(topology.face_areas(box)) == sorted(4 * [3.0] + 4 * [7.5] + 4 * [5.0])
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    turned = TriangleMesh(0.7 * box.vertices @ turn, box.faces)
    assert_allclose(topology.surface_area(turned), 0.49 * 62.0, rtol=1e-14)  # rounding


def test_two_balls_as_one_mesh_are_two_pieces_with_their_areas():
    small, large = shapes.sphere(4), shapes.sphere(4)
    large = TriangleMesh(3.0 * large.vertices, large.faces)
    both = topology.concatenate([small, large])
    assert_array_equal(both.vertices[both.faces[len(small.faces) :]], large.vertices[large.faces])
    piece, area = topology.component_areas(both)
    assert_array_equal(piece, np.repeat([0, 1], [len(small.faces), len(large.faces)]))
    assert_allclose(area[1], 9.0 * area[0], rtol=1e-12)  # rounding


def test_an_edge_of_three_faces_is_refused():
    fin = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    with pytest.raises(InputError, match="more than two faces"):
        topology.boundary_loops(fin)


def test_neighbours_oriented_against_each_other_are_refused():
    with pytest.raises(InputError, match="against each other"):
        topology.hinges(TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 2, 3][::1]]))
