"""Rest shapes found from how a garment hung: known lengths come back, and the garment reproduces its scan."""

import numpy as np
import pytest
import trimesh
from cloth_scenes import fabric, sheet, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.rest_shape.edge_length_embedding import embed_edge_lengths
from vto_pipeline.cloth.rest_shape.from_hanging import RestShapeConfig, rest_shape
from vto_pipeline.errors import ConfigError
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, GAP = 0.05, 3e-3
SOFT = fabric(stretch=40.0, shear=15.0, bending=1e-6, density=0.25)
"""Its own weight stretches 0.2 m of it by 9.8 · 0.25 · 0.2 / 40 = 1.2 % at the top, by half of that in the mean."""


def lengths(positions, mesh):
    ends = edges(mesh)
    return np.linalg.norm(positions[ends[:, 1]] - positions[ends[:, 0]], axis=1)


def bar():
    """A round bar, whose axis is z."""
    mesh = trimesh.creation.cylinder(radius=RADIUS, height=0.5, sections=96)
    return TriangleMesh(mesh.vertices, mesh.faces)


def towel(columns=13, rows=37):
    """Cloth laid over the bar, 3 mm off it, hanging down by 0.2 m on both sides; it is not stretched."""
    arc = 0.5 * np.pi * (RADIUS + GAP)
    half = arc + 0.2
    s, z = np.meshgrid(np.linspace(-half, half, rows), np.linspace(-0.1, 0.1, columns), indexing="ij")
    turn, below = np.clip(s, -arc, arc) / (RADIUS + GAP), np.maximum(np.abs(s) - arc, 0.0)
    x, y = (RADIUS + GAP) * np.sin(turn), (RADIUS + GAP) * np.cos(turn) - below
    flat = sheet(columns, rows, 1.0, 1.0)
    return TriangleMesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), flat.faces)


@pytest.fixture(scope="module")
def scan():
    """A towel that has come to rest on the bar, and how it was cut."""
    cut = towel()
    settings = {"place": "as_it_stands", "target_error_mm": 0.1, "settle_seconds": 6.0}
    hung = drape(Garment(cut, RestShape(cut.vertices)), bar(), SOFT, settings)
    return cut, hung.mesh


def errors(found, cut):
    return np.abs(lengths(found.positions, cut) / lengths(cut.vertices, cut) - 1.0)


def test_lengths_that_can_be_met_are_met_and_nothing_else_changes():
    cut = tube(0.125, 0.3, 48, 16)
    pairs = edges(cut)
    wider = cut.vertices * np.array([1.02, 0.98, 1.02])
    found = embed_edge_lengths(cut.vertices, pairs, lengths(wider, cut))
    assert_allclose(lengths(found, cut), lengths(wider, cut), rtol=2e-4)  # the way is convex, and staying weighs 1e-4
    assert_allclose(found.mean(axis=0), cut.vertices.mean(axis=0), rtol=0, atol=1e-4)
    assert_allclose(
        embed_edge_lengths(cut.vertices, pairs, lengths(cut.vertices, cut)), cut.vertices, rtol=0, atol=1e-12
    )


def test_a_known_rest_shape_comes_back(scan):
    cut, hung = scan
    plain = rest_shape(hung, RestShapeConfig(), Job())
    assert 0.002 < np.median(errors(plain, cut)) < 0.05  # else there is nothing to find
    job = Job()
    config = RestShapeConfig(mode="inverse", rounds=3, reproduced_mm=0.05, target_error_mm=0.1, settle_seconds=6.0)
    found = rest_shape(hung, config, job, bar(), SOFT)
    assert found.mode == "inverse"
    assert np.median(errors(found, cut)) < 0.005  # the bar
    assert np.median(errors(found, cut)) < 0.5 * np.median(errors(plain, cut))
    assert job.metrics["scan_distance_mm"] < 0.25 * job.metrics["scan_distance_before_mm"]
    assert job.metrics["scan_distance_mm"] < 1.0
    again = drape(Garment(hung, found), bar(), SOFT, {"place": "as_it_stands", "target_error_mm": 0.1})
    assert np.linalg.norm(again.mesh.vertices - hung.vertices, axis=1).mean() < 1.5e-3  # the bar


def test_lengths_stay_within_the_bound(scan):
    _, hung = scan
    config = RestShapeConfig(mode="gravity_removed", bound=0.002, settle_seconds=1.0)
    found = rest_shape(hung, config, Job(), bar(), SOFT)
    change = np.abs(lengths(found.positions, hung) / lengths(hung.vertices, hung) - 1.0)
    assert 0.001 < np.percentile(change, 95) < 0.003  # lengths are met in the sense of least squares


@pytest.mark.parametrize("mode", ["gravity_removed", "inverse"])
def test_without_the_body_it_was_on_it_cannot_be_found(scan, mode):
    with pytest.raises(ConfigError, match="that body is not known"):
        rest_shape(scan[1], RestShapeConfig(mode=mode), Job(), None, SOFT)
