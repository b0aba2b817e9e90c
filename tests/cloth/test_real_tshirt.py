"""A real T-shirt on real bodies it was never on; judged by ipctk."""

from pathlib import Path

import numpy as np
import pytest
from ipc_judge import crosses

from vto_pipeline.cloth.drape import drape
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh

DATA = Path(__file__).parents[3] / "shared" / "data"
BODIES = ["mh_male_averageweight", "mh_female_averageweight", "mh_female_maxweight"]


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize("body", BODIES)
def test_tshirt(body):
    person = read_mesh(DATA / "bodies" / f"{body}.ply")
    found = drape(read_mesh(DATA / "garments" / "tshirt.ply"), person, read_fabric("jersey"))
    assert found.audit["settled"] is True
    assert found.audit["penetration_mm"] == 0.0
    assert found.audit["body_intersections"] == found.audit["self_intersections"] == 0
    assert 0.0 < found.audit["rms_stretch"] < 0.05
    assert not crosses(found.mesh, person)
    assert crosses(TriangleMesh(found.mesh.vertices + np.array([0, 0, 0.01]), found.mesh.faces), person)  # it can tell
