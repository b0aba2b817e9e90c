"""What is put back on a surface comes to lie in its own layer, however near another one is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapes
import trimesh
from numpy.testing import assert_allclose
from slow_cases import every

from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.remeshing.layers import Layers
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.topology import concatenate, face_normals
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

GARMENTS = Path(__file__).parents[3] / "shared" / "data" / "garments" / "berkeley"

GAP = 0.002  # m


def facing_sheets():
    """Two square sheets, the upper facing up and the lower facing down."""
    upper = shapes.grid(6, 6, 0.05)
    if face_normals(upper)[0, 2] < 0.0:
        upper = TriangleMesh(upper.vertices, upper.faces[:, ::-1])
    lower = TriangleMesh(upper.vertices - [0.0, 0.0, GAP], upper.faces[:, ::-1])
    return concatenate([upper, lower])


@pytest.mark.parametrize("height", [0.01, 0.0, -0.4 * GAP, -0.6 * GAP, -GAP, -0.01])
def test_between_two_sheets_the_side_it_faces_counts(height):
    layers, place = Layers(facing_sheets(), 0.02), np.array([[0.11, 0.13, height]])
    up, down = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    assert_allclose(layers.nearest(place, up), [[0.11, 0.13, 0.0]], rtol=0, atol=1e-12)
    assert_allclose(layers.nearest(place, down), [[0.11, 0.13, -GAP]], rtol=0, atol=1e-12)


def test_a_surface_that_nowhere_faces_alike_is_met_where_it_is_nearest():
    sheet = shapes.grid(6, 6, 0.05)
    against = -face_normals(sheet)[:1]
    assert_allclose(Layers(sheet, 0.02).nearest(np.array([[0.1, 0.1, 0.03]]), against), [[0.1, 0.1, 0.0]], atol=1e-12)


def test_in_a_double_wall_the_nearest_of_all_faces_that_face_alike_is_found():
    """Brute force over all faces; points lie between the walls of a tube, and face as one of them, to 40 degrees."""
    outer = shapes.tube(24, 12, radius=0.05, length=0.2, wave=0.0)
    if (face_normals(outer)[0] * shapes.centers(outer)[0] * [1.0, 0.0, 1.0]).sum() < 0.0:
        outer = TriangleMesh(outer.vertices, outer.faces[:, ::-1])
    inner = TriangleMesh(outer.vertices * [1.0 - GAP / 0.05, 1.0, 1.0 - GAP / 0.05], outer.faces[:, ::-1])
    wall, rng = concatenate([outer, inner]), np.random.default_rng(1)
    turn, count = rng.uniform(0.0, 2.0 * np.pi, 300), 300
    radial = np.column_stack([np.cos(turn), np.zeros(count), np.sin(turn)])
    points = rng.uniform(0.045, 0.053, (count, 1)) * radial
    points[:, 1] = rng.uniform(0.01, 0.19, count)
    normals = rng.choice([-1.0, 1.0], (count, 1)) * radial + rng.uniform(-0.5, 0.5, (count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = Layers(wall, 0.02).nearest(points, normals)
    corners, facing, changed = wall.vertices[wall.faces], face_normals(wall), 0
    for point, normal, place in zip(points, normals, found, strict=True):
        away = [
            np.linalg.norm(trimesh.triangles.closest_point(some, np.tile(point, (len(some), 1))) - point, axis=1).min()
            for some in (corners[facing @ normal >= 0.0], corners)
        ]
        assert_allclose(np.linalg.norm(place - point), away[0], rtol=0, atol=1e-9)
        changed += away[0] > away[1] + 1e-6
    assert 50 < changed < 250  # of all places, another one was nearer


@pytest.mark.real_data
@pytest.mark.skipif(not GARMENTS.exists(), reason="the garments are not part of the repository")
@pytest.mark.parametrize("name", ["shirt", "blouse-short"])
@pytest.mark.parametrize("edge_mm", every(5, [15.0, 20.0, 17.0, 12.0, 10.0]))
def test_collars_do_not_cross_themselves_once_they_are_remeshed(name, edge_mm):
    garment = read_mesh(GARMENTS / name / f"{name}-iso.obj")
    assert len(self_intersections(garment)) == 0
    assert len(self_intersections(remesh(garment, RemeshConfig(edge_mm=edge_mm), Job()))) == 0
