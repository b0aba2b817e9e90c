"""A real T-shirt on real bodies it was never on; judged by ipctk."""

from pathlib import Path

import ipctk
import numpy as np
import pytest

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
    assert 0.0 < found.audit["rms_stretch"] < 0.05
    assert not crosses(found.mesh, person)
    assert crosses(TriangleMesh(found.mesh.vertices + np.array([0, 0, 0.01]), found.mesh.faces), person)  # it can tell


def crosses(cloth, body):
    """Whether the garment and what of the body is near it cross, each other or themselves; the face crosses itself."""
    corners = body.vertices[body.faces]
    low, high = cloth.vertices.min(axis=0), cloth.vertices.max(axis=0)
    near = body.faces[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)]
    vertices = np.vstack([cloth.vertices, body.vertices])
    faces = np.vstack([cloth.faces, near + len(cloth.vertices)])
    return ipctk.has_intersections(ipctk.CollisionMesh(vertices, ipctk.edges(faces), faces), vertices)
