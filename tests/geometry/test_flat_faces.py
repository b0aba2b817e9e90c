"""Panels carried over onto other meshes: what lies in a plane is known in closed form before it is rolled up."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from shapes import grid

from vto_pipeline.geometry.remeshing.flat_faces import carry_flat_faces, panel_of_faces, stretch_flat_faces
from vto_pipeline.geometry.topology import hinge_halves
from vto_pipeline.model.mesh import TriangleMesh

RADIUS = 0.1


def sides(corners):
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def turned(points, angle, shift):
    return points @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).T + shift


def tube(around, along, start=0.0, height=0.4):
    """A tube about z with a wavy net, and its corners unrolled: (angle R, z) of each face, shape (F, 3, 2)."""
    i, j = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    turn = start + 2 * np.pi * (i + 0.5 * (j % 2)) / around
    z = height * j / (along - 1)
    points = np.stack([RADIUS * np.cos(turn), RADIUS * np.sin(turn), z], axis=-1).reshape(-1, 3)
    faces, flat = [], []
    for a in range(around):
        for b in range(along - 1):
            odd = b % 2
            low, right = (a, b), (a + 1, b)
            up, far = (a, b + 1), (a + 1, b + 1)
            pair = ((low, right, far), (low, far, up)) if odd else ((low, right, up), (right, far, up))
            for face in pair:
                faces.append([(x % around) * along + y for x, y in face])
                flat.append(
                    [(RADIUS * 2 * np.pi * (x + 0.5 * (y % 2)) / around, height * y / (along - 1)) for x, y in face]
                )
    return TriangleMesh(points, np.array(faces)), np.array(flat)


def geodesic(mesh, stretch=(1.0, 1.0)):
    """The sides of faces on a tube as they are unrolled and stretched, shape (F, 3)."""
    x = mesh.vertices[mesh.faces]
    ends = np.roll(x, -1, axis=1)
    turn = np.angle(np.exp(1j * (np.arctan2(ends[..., 1], ends[..., 0]) - np.arctan2(x[..., 1], x[..., 0]))))
    return np.hypot(stretch[0] * RADIUS * turn, stretch[1] * (ends[..., 2] - x[..., 2]))


def test_on_the_mesh_itself_nothing_changes():
    mesh, flat = tube(24, 9)
    laid = flat.copy()
    upper = mesh.vertices[mesh.faces][:, :, 2].mean(axis=1) > 0.2
    laid[upper] = turned(laid[upper], 0.7, [3.0, 1.0])  # another panel, its grain askew
    found = carry_flat_faces(mesh, laid, mesh)
    assert_allclose(found, laid, rtol=0, atol=1e-12, err_msg="rounding only")


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (1.12, 0.93)])
def test_another_mesh_gets_the_lengths_of_the_panels_across_seams(stretch):
    """Two panels, one above the other, each sewn to itself along the tube, worn stretched."""
    mesh, flat = tube(96, 41)
    laid = flat * np.array(stretch)
    upper = mesh.vertices[mesh.faces][:, :, 2].mean(axis=1) > 0.2
    laid[upper] = turned(laid[upper], 2.0, [3.0, 1.0])
    assert len(np.unique(panel_of_faces(mesh, laid))) == 2
    other, _ = tube(37, 18, start=0.3)
    found = carry_flat_faces(mesh, laid, other)
    # a chord of one of 37 parts lies 0.4 mm below the tube; its image is the chord of the finer tube's facets: 1e-3
    assert_allclose(sides(found), geodesic(other, stretch), rtol=3e-3)
    one, two = hinge_halves(other).T
    assert_allclose(sides(found).ravel()[one], sides(found).ravel()[two], rtol=1e-9, err_msg="sewn sides are alike")
    cloth = 0.5 * np.abs(np.linalg.det(found[:, 1:] - found[:, :1])).sum()
    assert_allclose(cloth, stretch[0] * stretch[1] * 2 * np.pi * RADIUS * 0.4, rtol=2e-3)
    warp = turned(np.array([[0.0, 1.0]]), 2.0, 0.0)[0]  # where the upper panel's axis of the tube lies
    high = other.vertices[other.faces][:, :, 2].min(axis=1) > 0.22
    along = [np.linalg.solve((f[1:] - f[0]).T, warp) for f in found[high]]
    up = np.einsum("fk,fkd->fd", along, (other.vertices[other.faces][:, 1:] - other.vertices[other.faces][:, :1])[high])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    assert (up[:, 2] > 0.99).all()


def test_no_cloth_is_lost_where_the_other_mesh_cuts_folds_short():
    """A tube crumpled to bellows, and a mesh over its ridges only: what lies between them is still as long."""
    mesh, laid = tube(96, 41)
    ring = np.arange(len(mesh.vertices)) % 41
    crumpled = mesh.vertices * np.where(ring % 2 == 0, 1.0, 0.8)[:, None] ** (1, 1, 0)
    other, _ = tube(37, 21, start=0.3)
    found = carry_flat_faces(TriangleMesh(crumpled, mesh.faces), laid, other)
    assert_allclose(sides(found), geodesic(other), rtol=3e-3)  # as for the smooth tube


@pytest.mark.parametrize(("cut", "around"), [(60.0, 41), (10.0, 12)])
def test_across_a_dart_lengths_are_those_of_the_sewn_cone(cut, around):
    """A disc from which a wedge is cut out, sewn to a cone: polar coordinates in the plane are known."""
    share = 1.0 - cut / 360.0

    def cone(rings, around, start):
        radius = np.concatenate([[0.0], np.repeat(np.linspace(0.01, 0.2, rings), around)])
        turn = np.concatenate([[0.0], np.tile(start + 2 * np.pi * np.arange(around) / around, rings)])
        place = np.column_stack(
            [share * radius * np.cos(turn), share * radius * np.sin(turn), -np.sqrt(1 - share**2) * radius]
        )
        faces, wrapped = [], []
        for a in range(around):
            b, last = (a + 1) % around, a == around - 1
            faces.append([0, 1 + a, 1 + b])
            wrapped.append([0, 0, last])
            for k in range(rings - 1):
                p, q = 1 + k * around, 1 + (k + 1) * around
                faces += [[p + a, q + a, q + b], [p + a, q + b, p + b]]
                wrapped += [[0, 0, last], [0, last, last]]
        faces, flat_turn = np.array(faces), share * (turn[np.array(faces)] + 2 * np.pi * np.array(wrapped))
        flat_turn[faces == 0] = flat_turn[:, 1][np.nonzero(faces == 0)[0]]
        laid = radius[faces][..., None] * np.stack([np.cos(flat_turn), np.sin(flat_turn)], axis=-1)
        return TriangleMesh(place, faces), laid

    mesh, laid = cone(24, 120, 0.0)
    other, truth = cone(13, around, 0.05)
    found = carry_flat_faces(mesh, laid, other)
    assert_allclose(sides(found), sides(truth), rtol=5e-3)  # facets of 3 degrees


def test_three_corners_on_a_straight_border_span_what_they_span_in_space():
    mesh, laid = tube(96, 41)
    rim = mesh.vertices[[0, 2 * 41, 7 * 41]]  # along an arc in space, along a line in the panel
    top = mesh.vertices[[2 * 41 + 20]]
    other = TriangleMesh(np.concatenate([rim, top]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3]]))
    found = carry_flat_faces(mesh, laid, other)
    arc = RADIUS * 2 * np.pi * np.array([7.0, 5.0, 2.0]) / 96
    assert_allclose(sides(found)[0], arc, rtol=9e-3)  # chords of up to 26 degrees are shorter by as much
    area = 0.5 * np.abs(np.linalg.det(found[:, 1:] - found[:, :1]))
    in_space = 0.5 * np.linalg.norm(np.cross(rim[1] - rim[0], rim[2] - rim[0]))
    assert_allclose(area[0], in_space, rtol=0.02)
    assert area[0] < 0.05 * area[1]


def test_flat_faces_stretch_as_their_mesh_does():
    mesh = grid(6, 5)
    laid = 0.9 * mesh.vertices[mesh.faces][:, :, :2]
    found = stretch_flat_faces(laid, mesh, mesh.vertices * np.array([1.3, 0.8, 1.0]))
    assert_allclose(sides(found), sides(laid * np.array([1.3, 0.8])), rtol=1e-12)
    along = [np.linalg.solve((f[1:] - f[0]).T, [0.0, 1.0]) for f in found]
    up = np.einsum("fk,fkd->fd", along, (mesh.vertices[mesh.faces][:, 1:] - mesh.vertices[mesh.faces][:, :1]))
    assert_allclose(up[:, 0], 0.0, rtol=0, atol=1e-12, err_msg="the warp stays the warp")
