"""A real T-shirt on real bodies it was never on; judged by ipctk.

`pytest --log-cli-level=info` shows the seconds, compiling apart.
"""

import logging
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bars import missed
from ipc_judge import crosses

from vto_pipeline.cloth.drape import drape
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh

LOG = logging.getLogger(__name__)
DATA = Path(__file__).parents[3] / "shared" / "data"
BODIES = ["mh_male_averageweight", "mh_female_averageweight", "mh_female_maxweight"]


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize(("body", "finer"), [*((body, 0) for body in BODIES), (BODIES[0], 1), (BODIES[0], 2)])
def test_tshirt(body, finer):
    """6,436 vertices, and each triangle divided in four, once or twice: 25,610 and 102,166."""
    person, shirt = read_mesh(DATA / "bodies" / f"{body}.ply"), read_mesh(DATA / "garments" / "tshirt.ply")
    drape(shirt, person, read_fabric("jersey"), {"time_budget_s": 1.0})  # compiles
    for _ in range(finer):
        shirt = TriangleMesh(*trimesh.remesh.subdivide(shirt.vertices, shirt.faces))
    began = time.perf_counter()
    found = drape(shirt, person, read_fabric("jersey"))
    LOG.info("%s, %d vertices: %.1f s", body, len(shirt.vertices), time.perf_counter() - began)
    audit, words = found.audit, ("settled", "residual", "judged_residual", "rms_stretch", "penetration_mm")
    figures = {word: audit[word] for word in words} | {
        "predicted_mm": found.trace[-1].error_mm,
        "body_crossings": audit["body_intersections"],
        "self_crossings": audit["self_intersections"],
    }
    LOG.info("%s", figures)
    assert not missed("real_tshirt", figures)
    assert audit["judged_residual_left_out"] < 0.1 * len(shirt.vertices)
    assert not crosses(found.mesh, person)
    assert crosses(TriangleMesh(found.mesh.vertices + np.array([0, 0, 0.01]), found.mesh.faces), person)  # it can tell
