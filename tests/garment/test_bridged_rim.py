"""A rim that was bridged straight through the body still belongs to the opening that the body passes through."""

import numpy as np
import trimesh

from vto_pipeline.garment.loop_evidence import encloses, passes_through
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.mesh import TriangleMesh


def test_a_quarter_of_the_rim_inside_does_not_close_an_opening() -> None:
    post = trimesh.creation.cone(radius=0.1, height=0.4, sections=96)  # widens below the rim, as shoulders do
    body = SurfaceDistance(TriangleMesh(post.vertices[:, [1, 2, 0]], post.faces))
    angle = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
    radius = np.where(angle < np.pi / 2.0, 0.035, 0.055)  # the cone is 0.05 m wide at half its height
    ring = np.column_stack([radius * np.sin(angle), np.full(240, 0.2), radius * np.cos(angle)])
    assert encloses(ring, body, 0.06) or encloses(ring[::-1], body, 0.06)


def test_a_body_that_bulges_into_a_hole_does_not_pass_through_it() -> None:
    post = trimesh.creation.cylinder(radius=0.1, height=0.8, sections=96)
    body = SurfaceDistance(TriangleMesh(post.vertices[:, [1, 2, 0]], post.faces))
    turn = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
    angle = np.radians(65.0) * np.cos(turn)  # a hole in a tube 5 mm off; the post comes 26 mm through its disc
    hole = np.column_stack([0.105 * np.sin(angle), 0.08 * np.sin(turn), 0.105 * np.cos(angle)])
    around = np.column_stack([0.105 * np.sin(turn), 0.0 * turn, 0.105 * np.cos(turn)])
    for loop in (hole, hole[::-1]):
        assert not passes_through(loop, body)
    assert passes_through(around, body)
    assert passes_through(around[::-1], body)
