"""A body and what it wears as one solid."""

import numpy as np
import pytest
import trimesh
from cloth_scenes import ball, moved, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.outfit.body_with_layers import wrap_in_surface
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.mesh import TriangleMesh

ROOM = 0.005  # m, as the module has it


def holds(mesh, points):
    """Whether points are inside a closed mesh: sums of solid angles, van Oosterom & Strackee 1983."""
    angle = []
    for point in np.asarray(points):
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces] - point, 1, 0)
        x, y, z = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
        low = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
        angle.append(2.0 * np.arctan2((a * np.cross(b, c)).sum(axis=1), low).sum())
    return np.array(angle) > 2.0 * np.pi


def solid(*given):
    made = wrap_in_surface(*given)
    mesh = trimesh.Trimesh(made.vertices, made.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0.0  # outward
    return made, mesh.volume


def test_a_bare_body_grows_by_the_room():
    made, volume = solid(ball(0.2, levels=4), [])
    # the grid's edges are cut by straight lines, at 10 mm: h² / 8 r = 0.06 mm, and the icosphere is 0.3 mm flat
    assert_allclose(np.linalg.norm(made.vertices, axis=1), 0.2 + ROOM, rtol=0, atol=1e-3)
    assert_allclose(volume, 4.0 / 3.0 * np.pi * (0.2 + ROOM) ** 3, rtol=0.02)


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_skirt_is_in_it_and_so_is_the_air_under_it(inside_out):
    skirt = tube(0.3, 0.4, 60, 16, base=-0.5)
    if inside_out:
        skirt = TriangleMesh(skirt.vertices, skirt.faces[:, ::-1])
    body = ball(0.2, levels=4)
    made, _ = solid(body, [skirt])
    assert len(intersecting_faces(skirt, made)) == len(intersecting_faces(body, made)) == 0
    assert holds(made, skirt.vertices[::20]).all()
    # between skirt and body, below the body, and in the body where the skirt is about it
    assert holds(made, [[0.28, -0.3, 0.0], [0.0, -0.4, 0.0], [0.0, -0.15, 0.0]]).all()
    assert not holds(made, [[0.32, -0.3, 0.0], [0.0, -0.52, 0.0], [0.25, 0.1, 0.0]]).any()


def test_it_is_made_finer_until_nothing_shows_through():
    cone = trimesh.creation.cone(0.01, 0.3, sections=8)  # its tip is far thinner than the first cubes
    spike = moved(TriangleMesh(cone.vertices, cone.faces), 0.0, 0.0, 0.15)
    made, _ = solid(ball(0.2, levels=3), [spike])
    assert len(intersecting_faces(spike, made)) == 0
