"""The dress form and the shirt that are committed: what every later measurement takes for granted."""

from pathlib import Path

import ipctk
import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.io.meshes import read_mesh

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.fixture(scope="module")
def form():
    return read_mesh(SAMPLES / "shirt_on_form" / "form.ply", unit="m")


@pytest.fixture(scope="module")
def shirt():
    return read_mesh(SAMPLES / "truth" / "shirt.ply", unit="m")


def loop_lengths(mesh):
    edges, count = np.unique(
        np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    border = edges[count == 1]
    links = coo_matrix((np.ones(len(border)), border.T), shape=(len(mesh.vertices),) * 2)
    _, loop = connected_components(links, directed=False)
    length = np.linalg.norm(mesh.vertices[border[:, 0]] - mesh.vertices[border[:, 1]], axis=1)
    return sorted(length[loop[border[:, 0]] == i].sum() for i in np.unique(loop[border[:, 0]]))


def test_form_is_one_closed_solid_standing_on_the_floor(form):
    solid = trimesh.Trimesh(form.vertices, form.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.body_count == 1
    assert 0.045 < solid.volume < 0.065
    assert abs(form.vertices[:, 1].min()) < 1e-4
    assert 0.85 < form.vertices[:, 1].max() < 0.95
    assert not ipctk.has_intersections(
        ipctk.CollisionMesh(form.vertices, ipctk.edges(form.faces), form.faces), form.vertices
    )


def test_form_is_not_symmetric_by_some_millimetres(form):
    from scipy.spatial import cKDTree

    mirrored = form.vertices * [-1.0, 1.0, 1.0]
    apart = cKDTree(form.vertices).query(mirrored)[0]
    assert 0.006 < apart.max() < 0.03  # vertices alone are up to 5 mm apart
    assert 0.001 < np.median(apart) < 0.006


def test_shirt_is_one_sheet_with_four_openings(shirt):
    sheet = trimesh.Trimesh(shirt.vertices, shirt.faces, process=False)
    assert sheet.is_winding_consistent
    assert sheet.body_count == 1
    lengths = loop_lengths(shirt)
    assert len(lengths) == 4
    assert sheet.euler_number == 2 - 4
    cuffs, neck, hem = lengths[:2], lengths[2], lengths[3]
    assert all(0.35 < cuff < 0.45 for cuff in cuffs)
    assert 0.5 < neck < 0.7
    assert 1.1 < hem < 1.35
    assert 20_000 < len(shirt.vertices) < 40_000


def test_shirt_meets_neither_itself_nor_the_form(shirt, form):
    vertices = np.concatenate([shirt.vertices, form.vertices])
    faces = np.concatenate([shirt.faces, form.faces + len(shirt.vertices)])
    assert not ipctk.has_intersections(ipctk.CollisionMesh(vertices, ipctk.edges(faces), faces), vertices)


def test_shirt_is_tight_on_the_shoulders_and_loose_below(shirt, form):
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(form.vertices.astype(np.float32), form.faces.astype(np.uint32))
    ease = scene.compute_signed_distance(shirt.vertices.astype(np.float32), nthreads=1).numpy()
    x, y, _ = shirt.vertices.T
    shoulders = (y > 0.80) & (np.abs(x) > 0.11) & (np.abs(x) < 0.16)
    hem = y < 0.25
    assert ease.min() > 0.0015
    assert 0.002 < np.median(ease[shoulders]) < 0.004
    assert 0.008 < np.median(ease[hem]) < 0.030
    assert 0.020 < ease.max() < 0.060


def test_folds_stand_up_to_some_fifteen_millimetres():
    from vto_pipeline.bench.samples.garments.folds import SLEEVE_FOLDS, TRUNK_FOLDS, fold_height, hem_flutes

    turn, height = np.meshgrid(np.linspace(-np.pi, np.pi, 400), np.linspace(0.2, 0.75, 200))
    trunk = fold_height(TRUNK_FOLDS, 0.15 * turn.ravel(), height.ravel(), 0.3 * np.pi)
    assert 0.010 < trunk.max() < 0.020
    assert -0.010 < trunk.min() < -0.001
    assert 0.010 < np.abs(hem_flutes(turn.ravel(), np.ones(turn.size))).max() < 0.019
    wrapped = fold_height(SLEEVE_FOLDS, np.array([-0.07 * np.pi, 0.07 * np.pi]), np.full(2, 0.15), 0.14 * np.pi)
    assert wrapped[0] == pytest.approx(wrapped[1], abs=1e-12)  # the back seam is no seam
