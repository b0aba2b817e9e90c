"""Openings keep their length when their garment is remeshed; where their rims turn; how far they have changed."""

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose

from vto_pipeline.geometry.remeshing import remesh as remesh_module
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.remeshing.rims import perimeter, rim_change, rim_corners
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, TOOTH = 0.12, 0.06


def jagged(teeth):
    """A tube whose upper rim runs up and down in straight lines: tall teeth, a corner at each tip and foot."""
    pipe = shapes.tube(96, 40, RADIUS, 0.3, 0.0)
    x = pipe.vertices.copy()
    turn = np.mod(np.arctan2(x[:, 2], x[:, 0]) / (2 * np.pi) * teeth, 1.0)
    height = (x[:, 1] - x[:, 1].min()) / np.ptp(x[:, 1])
    x[:, 1] += height * TOOTH * (1.0 - 2.0 * np.abs(turn - 0.5))
    return TriangleMesh(x, pipe.faces)


@pytest.mark.parametrize("teeth", [4, 6, 8])
def test_a_rim_with_corners_keeps_its_length(teeth):
    mesh, job = jagged(teeth), Job()
    even = remesh(mesh, RemeshConfig(edge_mm=10), job)
    step = np.hypot(RADIUS * 2 * np.pi / teeth / 2, TOOTH)  # the teeth lie on a cylinder
    lengths = sorted(perimeter(even, loop) for loop in boundary_loops(even))
    assert_allclose(lengths, [2 * np.pi * RADIUS, 2 * teeth * step], rtol=0.025)
    assert job.metrics["opening_change"] < 0.02


def test_corners_that_are_held_are_enough(monkeypatch):
    """Rims need not be pinned as a whole, which makes triangles beside them less even."""

    def pinned(*_):
        raise AssertionError("rims were pinned")

    monkeypatch.setattr(remesh_module, "_pinned", pinned)
    job = Job()
    remesh(jagged(6), RemeshConfig(edge_mm=10), job)
    assert job.metrics["opening_change"] < 0.02


@pytest.mark.parametrize("sides", [3, 4, 6])
def test_corners_are_those_of_a_polygon(sides):
    per = 24
    tips = np.column_stack([np.cos(2 * np.pi * np.arange(sides) / sides), np.sin(2 * np.pi * np.arange(sides) / sides)])
    share = np.arange(per)[:, None] / per
    sheet = np.vstack([a + share * (b - a) for a, b in zip(tips, np.roll(tips, -1, axis=0), strict=True)])
    path = np.column_stack([sheet, np.zeros(len(sheet))])
    mesh = TriangleMesh(path, np.array([[0, 1, 2]], np.int32))
    loop = np.arange(len(path), dtype=np.int32)
    assert sorted(rim_corners(mesh, np.roll(loop, 5), 0.1)) == list(range(0, sides * per, per))


def test_a_circle_has_no_corners_until_it_is_smaller_than_the_edges():
    turn = 2 * np.pi * np.arange(200) / 200
    mesh = TriangleMesh(np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]), np.array([[0, 1, 2]], np.int32))
    loop = np.arange(200, dtype=np.int32)
    assert len(rim_corners(mesh, loop, 0.6)) == 0  # chords of 0.6 turn by 0.6 rad, 34 degrees
    assert len(rim_corners(mesh, loop, 0.8)) > 0


def test_the_change_of_each_opening_is_that_of_its_chords():
    fine, coarse = shapes.tube(240, 5, 1.0, 2.0, 0.0), shapes.tube(12, 5, 1.0, 2.0, 0.0)
    chords = 12 * np.sin(np.pi / 12) / (240 * np.sin(np.pi / 240))
    assert_allclose(rim_change(fine, coarse), 1 - chords, rtol=1e-9)
    below = coarse.vertices[:, 1] < coarse.vertices[:, 1].mean()
    narrow = TriangleMesh(np.where(below[:, None], coarse.vertices * [0.5, 1, 0.5], coarse.vertices), coarse.faces)
    assert_allclose(rim_change(fine, narrow), 1 - 0.5 * chords, rtol=1e-9)
