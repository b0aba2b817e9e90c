"""A shirt on the project's own body, whose arms go down to the sides and up again."""

import logging

import numpy as np
import pytest
from bars import missed
from ipc_judge import crosses, self_crosses

from vto_pipeline.avatar.model.pose import morph, named_pose
from vto_pipeline.avatar.motion.path import avatar_path
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.template.template import template
from vto_pipeline.cloth.collision.body.yielding import give_way
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.dynamics.body_motion import run_body_motion
from vto_pipeline.cloth.judge.crossings import crossings_between
from vto_pipeline.cloth.moving.follow import follow
from vto_pipeline.cloth.rest import phases
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, submesh, vertex_normals
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

LOG = logging.getLogger(__name__)
WORN = ("spine", "chest", "left_clavicle", "right_clavicle", "left_shoulder", "right_shoulder")
EASE = 0.012  # m


def shirt(person):
    """The skin from waist to neck and elbows, moved out; its armpits then cross themselves."""
    own = np.array(person.joint_names)[person.weights.argmax(axis=1)]
    skin = TriangleMesh(person.vertices, person.faces)
    wider = TriangleMesh(skin.vertices + EASE * vertex_normals(skin), skin.faces)
    return submesh(wider, np.isin(own, WORN)[skin.faces].all(axis=1))[0]


@pytest.fixture
def watched(monkeypatch):
    """The cloth and the body at each look while the body moves; and how far the body gave way [m]."""
    frames, depths = [], []

    def giving(body, skin, about):
        found = give_way(body, skin, about)
        depths.append(found[1])
        return found

    def looked_at(stepper, state, body, deep, watch):
        run = stepper.run

        def looking(state, seconds):
            state = run(state, seconds)
            frames.append((state.positions, body.at(state.time)))
            return state

        stepper.run = looking
        state = run_body_motion(stepper, state, body, deep, watch)
        del stepper.run
        return state

    monkeypatch.setattr(phases, "run_body_motion", looked_at)
    monkeypatch.setattr(phases, "give_way", giving)
    return frames, depths


@pytest.mark.slow
def test_nothing_passes_through_anything_while_the_arms_go_down_and_up(watched):
    """In mid-motion too, not only at the end: at each look.

    The body there is one that gives way in the armpits, where the template's arms pass into its trunk.
    """
    person = template(0.5)
    down = morph(person, named_pose(person, "arms_down"), 15).keyframes
    body = MovingBody(np.concatenate([down, down[-2::-1]]), person.faces)
    mesh, job = shirt(person), Job()
    assert len(boundary_loops(mesh)) == 4
    settings = {"ride_up_to_mm": 10000.0}
    found = drape(Garment(mesh, RestShape(mesh.vertices)), body, read_fabric("cotton_poplin"), settings, job)
    watched, depths = watched
    assert len(watched) > 15
    swing = np.linalg.norm(np.ptp([body for _, body in watched], axis=0), axis=1).max()
    assert swing > 0.3  # m: it is the motion that was looked at
    crossing = [self_crosses(TriangleMesh(cloth, mesh.faces)) for cloth, _ in watched]
    figures = {
        "body_gives_way_mm": 1e3 * max(depths),
        "self_crossing_looks": sum(crossing),
        "body_crossings": max(
            len(crossings_between(TriangleMesh(cloth, mesh.faces), TriangleMesh(there, person.faces)))
            for cloth, there in watched
        ),
        "penetration_mm": max(
            -1e3 * SurfaceDistance(TriangleMesh(there, person.faces)).signed(cloth).distance.min()
            for cloth, there in watched
        ),
    }
    LOG.info("%d looks: %s", len(watched), figures)
    assert not missed("moving_arms", figures)
    assert found.audit["self_intersections"] == 0 == found.audit["body_intersections"]
    assert not crosses(found.mesh, body.final)
    assert SurfaceDistance(body.final).signed(found.mesh.vertices).distance.min() > 0
    assert found.audit["rms_stretch"] < 0.05
    assert "moving along with the body" not in dict(job.left_out)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["arms_up", "walking_step"])
def test_a_shirt_follows_a_motion_and_crosses_nothing_in_any_frame(preset):
    """By ipctk, which shares no code with the project."""
    person, fabric = template(0.5), read_fabric("cotton_poplin")
    mesh = shirt(person)
    garment = Garment(mesh, RestShape(mesh.vertices))
    still = drape(garment, TriangleMesh(person.vertices, person.faces), fabric)
    read = read_motion(preset)
    config = RetargetConfig(lead_in_s=1.0, frames_per_second=30)
    path = avatar_path(person, retarget(read.clip, read.joints, person, config)[0])
    motion, found = follow(Garment(still.mesh, garment.rest), path, fabric)
    assert len(motion.frames) == path.frames > 30
    assert np.linalg.norm(np.ptp([path.at(path.time(k)) for k in range(path.frames)], axis=0), axis=1).max() > 0.3
    bodies = [TriangleMesh(path.at(path.time(k)), path.faces) for k in range(path.frames)]
    cloth = [TriangleMesh(frame, motion.faces) for frame in motion.frames]
    assert [k for k, (one, body) in enumerate(zip(cloth, bodies, strict=True)) if crosses(one, body)] == []
    assert [k for k, one in enumerate(cloth) if self_crosses(one)] == []
    assert found["max_stretch"] < 0.3
