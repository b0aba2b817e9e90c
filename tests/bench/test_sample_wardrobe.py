"""Garments that are cut for a body: openings, one clean sheet, outside the body, whatever its size."""

from functools import cache

import ipctk
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.bench.samples.garments.wardrobe import WARDROBE
from vto_pipeline.bench.samples.garments.wearer import SIZES, wearer
from vto_pipeline.geometry.topology import boundary_loops

OPENINGS = {"shirt": 4, "dress": 4, "skirt": 2, "trousers": 3}


@cache
def made(size, name):
    return WARDROBE[name](wearer(size), 30.0)


@pytest.fixture(params=[name if name == "average" else pytest.param(name, marks=pytest.mark.slow) for name in SIZES])
def size(request):
    return request.param


@pytest.mark.parametrize("name", WARDROBE)
def test_a_garment_is_one_clean_sheet_about_the_body(size, name):
    import open3d

    mesh, body = made(size, name).mesh, wearer(size).avatar.mesh
    sheet = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert sheet.is_winding_consistent
    assert sheet.body_count == 1
    assert len(boundary_loops(mesh)) == OPENINGS[name]
    assert sheet.euler_number == 2 - OPENINGS[name]  # no handles
    vertices = np.concatenate([mesh.vertices, body.vertices])
    faces = np.concatenate([mesh.faces, body.faces + len(mesh.vertices)])
    assert not ipctk.has_intersections(ipctk.CollisionMesh(vertices, ipctk.edges(faces), faces), vertices)
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(body.vertices.astype(np.float32), body.faces.astype(np.uint32))
    gap = scene.compute_signed_distance(mesh.vertices.astype(np.float32), nthreads=1).numpy()
    assert 0.004 < gap.min() < 0.02
    assert 0.015 < np.median(gap) < 0.15
    edges = np.linalg.norm(np.diff(mesh.vertices[sheet.edges_unique], axis=1)[:, 0], axis=1)
    assert_allclose(np.median(edges), 0.030, rtol=0.15)


def test_hems_end_where_they_are_said_to(size):
    low = {name: made(size, name).mesh.vertices[:, 1].min() for name in WARDROBE}
    body = wearer(size)
    assert_allclose(low["shirt"], body.hip - 0.03, rtol=0, atol=2e-3)
    assert_allclose(low["dress"], body.knee + 0.02, rtol=0, atol=2e-3)
    assert_allclose(low["skirt"], body.knee + 0.06, rtol=0, atol=2e-3)
    assert_allclose(low["trousers"], body.ankle + 0.06, rtol=0, atol=2e-3)


@pytest.mark.parametrize(("name", "tight"), [("skirt", 0.15), ("trousers", 0.08)])
def test_a_waistband_is_tighter_than_the_waist(size, name, tight):
    garment, body = made(size, name), wearer(size)
    loop = max(boundary_loops(garment.mesh), key=lambda one: garment.mesh.vertices[one, 1].mean())

    def around(positions):
        return np.linalg.norm(positions[loop] - np.roll(positions[loop], 1, axis=0), axis=1).sum()

    worn, rest = around(garment.mesh.vertices), around(garment.rest.positions)
    assert_allclose(rest / worn, 1.0 - tight, rtol=0.005)
    section = trimesh.Trimesh(body.avatar.vertices, body.avatar.faces, process=False).section(
        [0.0, 1.0, 0.0], [0.0, body.waist, 0.0]
    )
    waist = max(section.discrete, key=lambda path: -abs(path[:, 0].mean()))
    girth = np.linalg.norm(np.diff(waist, axis=0), axis=1).sum()
    assert 0.9 < rest / girth < 1.01
    below = garment.mesh.vertices[:, 1] < body.waist - 0.09
    assert_allclose(garment.rest.positions[below], garment.mesh.vertices[below], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_the_shirt_of_a_larger_body_is_larger():
    area = {}
    for name in SIZES:
        mesh = made(name, "shirt").mesh
        area[name] = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).area
    assert area["slim"] < area["average"] < area["large"] < 1.6 * area["slim"]
