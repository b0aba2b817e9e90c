"""Remeshing keeps shape and openings, and makes even triangles."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.remeshing.decimate import faces_at
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, edge_lengths, remesh
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


@pytest.mark.parametrize(("around", "along"), [(60, 40), (314, 200)], ids=["coarse", "fine"])
def test_a_tube_keeps_its_openings(around, along):
    pipe = shapes.tube(around, along)
    job = Job()
    even = remesh(pipe, RemeshConfig(edge_mm=12.0), job)
    assert is_manifold(even)
    rims = boundary_loops(even)
    wanted = [perimeter(pipe, loop) for loop in boundary_loops(pipe)]
    assert_allclose([perimeter(even, loop) for loop in rims], wanted, rtol=0.01)  # the promise to users
    steps = np.concatenate([np.linalg.norm(np.diff(even.vertices[loop], axis=0), axis=1) for loop in rims])
    assert 0.006 < steps.min() < steps.max() < 0.018  # rims are remeshed too, not kept as they were
    length = edge_lengths(even)
    assert_allclose(np.median(length), 0.012, rtol=0.1)
    assert np.percentile(length, 95) / np.percentile(length, 5) < 1.8
    assert 0.05 < job.metrics["hausdorff_mm"] < 1.0  # chord height of 12 mm edges on a 150 mm radius: 0.12 mm
    assert len(self_intersections(even)) == 0


def cuffed(flat):
    """A tube that narrows to a cuff, 0.145 m round, more or less pressed flat."""
    pipe = shapes.tube(60, 30, radius=0.06, length=0.3, wave=0.0)
    x, y, z = pipe.vertices.T
    along = y / 0.3
    narrow = 1.0 - along * (1.0 - 0.145 / (2.0 * np.pi * 0.06))
    pressed = narrow * (1.0 - along * (1.0 - flat))
    return TriangleMesh(np.column_stack([narrow * x, y, pressed * z]), pipe.faces)


@pytest.mark.parametrize("flat", [1.0, 0.3, 0.1], ids=["round", "oval", "pressed"])
@pytest.mark.parametrize("edge_mm", [13.0, 20.0, 30.0])
def test_a_cuff_that_is_small_beside_the_edges_stays_open(flat, edge_mm):
    """Its rim has five edges of 30 mm or more: where vertices slide along, they come together in a point."""
    sleeve = cuffed(flat)
    even = remesh(sleeve, RemeshConfig(edge_mm=edge_mm, iterations=5), Job())
    assert is_manifold(even)
    assert len(self_intersections(even)) == 0
    cuff, wanted = (
        min((mesh.vertices[loop] for loop in boundary_loops(mesh)), key=lambda p: -p[:, 1].mean())
        for mesh in (even, sleeve)
    )
    assert np.ptp(cuff[:, 1]) < 1e-9
    steps = np.linalg.norm(cuff - np.roll(cuff, -1, axis=0), axis=1)
    length = np.linalg.norm(wanted - np.roll(wanted, -1, axis=0), axis=1).sum()
    assert length - 1.5 * steps.mean() < steps.sum() < length  # chords cut its two turns, by a part of an edge each
    for axis in (0, 2):
        assert np.ptp(wanted[:, axis]) - steps.mean() < np.ptp(cuff[:, axis]) < np.ptp(wanted[:, axis]) + 1e-9
    assert steps.min() > 0.1e-3 * edge_mm


def test_long_edges_of_a_small_rim_are_halved():
    """A square hole of 30 mm in large triangles becomes one of edges of 10 mm and less, its corners where they were."""
    sheet = shapes.grid(9, 9, 0.03)
    middle = np.abs(shapes.centers(sheet)[:, :2] - 0.135).max(axis=1) < 0.015
    even = remesh(shapes.without(sheet, middle), RemeshConfig(edge_mm=11.0), Job())
    hole = min(boundary_loops(even), key=lambda loop: perimeter(even, loop))
    assert_allclose(perimeter(even, hole), 0.12, rtol=1e-6)
    steps = np.linalg.norm(np.diff(even.vertices[hole], axis=0), axis=1)
    assert 0.005 < steps.min() <= steps.max() < 0.016


def test_a_closed_surface_stays_closed():
    ball = shapes.sphere(4, radius=0.1)
    even = remesh(ball, RemeshConfig(edge_mm=15.0), Job())
    assert boundary_loops(even) == []
    assert_allclose(np.linalg.norm(even.vertices, axis=1), 0.1, rtol=5e-3)


def test_the_same_input_gives_the_same_bits():
    pipe = shapes.tube(80, 50)
    one, two = (remesh(pipe, RemeshConfig(edge_mm=12.0), Job()) for _ in range(2))
    assert_array_equal(one.vertices, two.vertices)
    assert_array_equal(one.faces, two.faces)


def test_a_piece_that_the_closing_cone_of_another_runs_through_is_kept():
    """Single faces of the sheet are nearest to the cone over the tube's end, and look as if they were of it."""
    pipe, sheet = shapes.tube(90, 60, radius=0.1, length=0.3), shapes.grid(30, 30, 0.01)
    across = np.column_stack(
        [sheet.vertices[:, 0] - 0.15, np.full(len(sheet.vertices), 0.34), sheet.vertices[:, 1] - 0.15]
    )
    both = TriangleMesh(
        np.vstack([pipe.vertices, across]), np.vstack([pipe.faces, sheet.faces[:, ::-1] + len(pipe.vertices)])
    )
    even = remesh(both, RemeshConfig(edge_mm=8.0), Job())
    assert len(boundary_loops(even)) == 3


def test_a_rim_that_waves_as_high_as_the_tube_is_wide_is_kept():
    pipe = shapes.tube(150, 60, radius=0.1, length=0.3, wave=0.09)
    even = remesh(pipe, RemeshConfig(edge_mm=8.0), Job())
    assert len(boundary_loops(even)) == 2
    assert_allclose(
        [perimeter(even, loop) for loop in boundary_loops(even)],
        [perimeter(pipe, loop) for loop in boundary_loops(pipe)],
        rtol=0.01,  # the promise to users
    )


def test_a_non_manifold_mesh_is_refused_with_a_hint():
    fin = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    with pytest.raises(InputError) as caught:
        remesh(fin, RemeshConfig(), Job())
    assert "repair" in caught.value.hint


def test_faces_at_counts_equilateral_triangles():
    assert faces_at(shapes.grid(10, 10, 0.01), 0.01) == 231  # 0.01 m² / 0.4330e-4 m², rounded up
