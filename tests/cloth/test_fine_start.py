"""A fine garment is put on as a coarse one is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from test_limbs import figure, tunic

from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.placement.body_growth import plan_body_growth
from vto_pipeline.cloth.placement.place import place_garment
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

DATA = Path(__file__).parents[3] / "shared" / "data"
HOOD = DATA / "patterns" / "garment_pattern_generator" / "basic tee" / "tee_hood.json"
SHIRT = DATA / "garments" / "berkeley" / "shirt" / "shirt-iso.obj"


@pytest.mark.parametrize(("made_for", "worn_by"), [pytest.param(0.0, 1.1, marks=pytest.mark.slow), (0.9, 0.0)])
def test_sleeves_go_on_arms_however_fine_they_are(made_for, worn_by):
    coarse, body = tunic(made_for), figure(worn_by)
    split = trimesh.Trimesh(coarse.vertices, coarse.faces, process=False).subdivide()
    fine = TriangleMesh(split.vertices, split.faces)
    assert len(fine.vertices) > 13_000
    found, few = (plan_body_growth(body, garment, Job()) for garment in (fine, coarse))
    assert found.fault == few.fault == (0, 0)
    off = np.linalg.norm(found.garment.vertices[: len(coarse.vertices)] - few.garment.vertices, axis=1)
    assert off.max() < 0.05  # it has room of 20 mm about the limbs
    edge, was = (
        np.linalg.norm(x[fine.faces] - np.roll(x[fine.faces], 1, axis=1), axis=2)
        for x in (found.garment.vertices, fine.vertices)
    )
    np.testing.assert_allclose(np.median(edge / was), 1.0, rtol=0.02)


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not SHIRT.is_file(), reason="shared data absent")
def test_a_long_sleeved_shirt_is_put_on_arms_that_hang():
    """12,000 vertices, its sleeves held out, its front open; the man's arms point down and bend."""
    body = read_mesh(DATA / "bodies" / "mh_male_averageweight.ply")
    mesh = remesh(read_mesh(SHIRT), RemeshConfig(), Job())
    placed = place_garment(Garment(mesh, RestShape(mesh.vertices)), body, checked(DrapeConfig, None), Job()).mesh
    assert len(placed.vertices) > 10_000
    growth = plan_body_growth(body, placed, Job())
    assert (growth.pierced, growth.fault) == (0, (0, 0))


@pytest.mark.real_data
@pytest.mark.skipif(not HOOD.is_file(), reason="shared data absent")
def test_a_body_grows_no_farther_than_it_must():
    """Sleeves laid onto arms alone are free of faults about a body of lines only; led further, about a stouter one."""
    body = read_mesh(DATA / "bodies" / "mh_female_averageweight.ply")
    mesh = in_shape(sew(read_pattern(HOOD), SewConfig(edge_mm=30.0), Job()), Job())
    garment = Garment(mesh, RestShape(mesh.vertices), laid_out=True)
    placed = place_garment(garment, body, checked(DrapeConfig, None), Job()).mesh
    growth = plan_body_growth(body, placed, Job())
    assert growth.fault == (0, 0)
    assert growth.thinned < 6
