"""Starts that no one would choose: each ends clean, judged by ipctk."""

import numpy as np
import pytest
from bad_starts import finned, shifted, sleeves_up, two, upside_down
from ipc_judge import crosses
from numpy.testing import assert_allclose

from vto_pipeline.bench.samples.garments.shirt import make_hanging_shirt
from vto_pipeline.bench.samples.solids.form import make_form
from vto_pipeline.cloth.drape import drape
from vto_pipeline.garment.simulation_mesh import SimulationMeshConfig, remesh_for_simulation
from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

COARSE = SimulationMeshConfig(edge_mm=26)
STAYS = {"place": "as_it_stands"}


@pytest.fixture(scope="module")
def dressed():
    """The sample's form, and its shirt in some 1,400 vertices."""
    form = make_form()
    shirt = remesh_for_simulation(make_hanging_shirt(form), COARSE, Job())
    assert 1000 < len(shirt.vertices) < 2000
    return shirt, form.mesh


def ends_clean(garment, body, settings=None, job=None):
    """Drape it, see that nothing crosses, and return what was found."""
    found = drape(garment, body, read_fabric("jersey"), settings, job)
    assert found.audit["finite"] is True
    assert found.audit["body_intersections"] == found.audit["self_intersections"] == 0
    assert found.audit["penetration_mm"] == 0.0
    assert not crosses(found.mesh, body)
    return found


def hangs_like(found, wanted, within):
    """Whether a garment ended where the other did, on average over its vertices [m]."""
    apart = np.linalg.norm(found.mesh.vertices - wanted.mesh.vertices, axis=1)
    assert apart.mean() < within


def test_a_shirt_upside_down_and_in_centimetres_is_put_right(dressed):
    shirt, form = dressed
    job = Job()
    strayed = TriangleMesh(100.0 * shirt.vertices * [-1.0, -1.0, 1.0], shirt.faces)
    found = ends_clean(strayed, form, job=job)
    assert any("assumed to be in cm" in note for note in job.notes)
    assert any(note.startswith("garment turned: its (-x, -y, z)") for note in job.notes)
    assert found.audit["too_small"] is False
    assert found.audit["rms_stretch"] < 0.03
    assert_allclose(
        found.mesh.vertices.mean(axis=0), shirt.vertices.mean(axis=0), rtol=0, atol=0.04
    )  # it sags a little


def test_a_body_thirty_percent_larger_stretches_the_shirt_and_that_is_told(dressed):
    shirt, form = dressed
    job = Job()
    found = ends_clean(TriangleMesh(shirt.vertices / 1.3, shirt.faces), form, job=job)
    assert found.audit["too_small"] is True
    assert found.audit["over_limit_share"] > 0.25
    # around the chest a shirt a shirt's ease too small must be a fifth longer than at rest; it may not be torn
    assert 0.1 < found.audit["rms_stretch"] < 0.3
    assert found.audit["largest_strain"] < 1.5
    assert any(text.startswith("too small:") and "stretched beyond 10%" in text for text in job.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("way", [(0.05, 0.0, 0.0), (0.0, -0.05, 0.0), (0.0, 0.0, 0.05)])
def test_a_shirt_shifted_into_the_body(dressed, way):
    shirt, form = dressed
    found = ends_clean(shifted(shirt, *way), form, STAYS)
    hangs_like(found, ends_clean(shirt, form), 0.025)  # friction holds it where it first lies


@pytest.mark.slow
def test_arms_through_the_sleeves(dressed):
    shirt, form = dressed
    start = sleeves_up(shirt)
    assert crosses(start, form)
    found = drape(start, form, read_fabric("jersey"), STAYS)
    assert not crosses(found.mesh, form)
    assert found.audit["largest_strain"] < 0.5


@pytest.mark.slow
def test_a_hundred_edges_of_three_faces(dressed):
    shirt, form = dressed
    job = Job()
    mesh = remesh_for_simulation(repair(finned(shirt), RepairConfig(), job), COARSE, job)
    assert any("non-manifold" in note for note in job.notes)
    assert any("dropped 100 of 101 pieces" in note for note in job.notes)
    ends_clean(mesh, form)


@pytest.mark.slow
def test_two_shirts_one_over_the_other(dressed):
    shirt, form = dressed
    found = ends_clean(two(shirt), form, STAYS)
    inner, outer = np.split(found.mesh.vertices, 2)
    outward = vertex_normals(TriangleMesh(inner, shirt.faces))
    assert np.median(np.einsum("vi,vi->v", outer - inner, outward)) > 0.0


@pytest.mark.slow
def test_a_shirt_left_upside_down_ends_elsewhere_and_that_is_told(dressed):
    shirt, form = dressed
    job = Job()
    found = ends_clean(upside_down(shirt), form, STAYS, job)
    assert found.audit["too_small"] is True
    assert any(text.startswith("it is worn elsewhere: it ended") for text in job.warnings)
