"""A shirt on the project's own body, whose arms go down to the sides and up again."""

import numpy as np
import pytest
from ipc_judge import crosses

from vto_pipeline.avatar.pose import morph, named_pose
from vto_pipeline.avatar.template import template
from vto_pipeline.cloth.drape import drape
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, submesh, vertex_normals
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

WORN = ("spine", "chest", "left_clavicle", "right_clavicle", "left_shoulder", "right_shoulder")
EASE = 0.012  # m


def shirt(person):
    """The skin from waist to neck and elbows, moved out; its armpits then cross themselves."""
    own = np.array(person.joint_names)[person.weights.argmax(axis=1)]
    skin = TriangleMesh(person.vertices, person.faces)
    wider = TriangleMesh(skin.vertices + EASE * vertex_normals(skin), skin.faces)
    return submesh(wider, np.isin(own, WORN)[skin.faces].all(axis=1))[0]


@pytest.mark.slow
def test_nothing_passes_through_anything_while_the_arms_go_down_and_up():
    person = template(0.5)
    down = morph(person, named_pose(person, "arms_down"), 15).keyframes
    body = MovingBody(np.concatenate([down, down[-2::-1]]), person.faces)
    mesh, job = shirt(person), Job()
    assert len(boundary_loops(mesh)) == 4
    settings = {"ride_up_to_mm": 10000.0}
    found = drape(Garment(mesh, RestShape(mesh.vertices)), body, read_fabric("cotton_poplin"), settings, job)
    assert found.audit["self_intersections"] == 0 == found.audit["body_intersections"]
    assert not crosses(found.mesh, body.final)
    assert SurfaceDistance(body.final).signed(found.mesh.vertices).distance.min() > 0
    assert found.audit["rms_stretch"] < 0.05
    assert "riding along with the body" not in dict(job.left_out)
