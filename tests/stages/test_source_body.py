"""From what the garment was on to the customer: which stages run, and what they hand to the drape."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.template.template import template
from vto_pipeline.io.documents import Document
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import read_request
from vto_pipeline.stages import CATALOGUE

MORPH = next(stage for stage in CATALOGUE.stages if stage.name == "mesh.morph")


def planned(tmp_path: Path, **given: dict[str, str]) -> list[str]:
    """The names of the stages that run."""
    for section in given.values():
        for name in section.values():
            (tmp_path / name).write_text("")
    data = {"schema": 1, "given": {**given, "fabric": "jersey"}, "want": ["draped", "fit_report"], "stages": {}}
    request = read_request(Document(data, tmp_path / "d.yaml"), tmp_path, CATALOGUE, ())
    return [step.stage.name for step in make_plan(request, CATALOGUE).steps]


def test_a_body_mesh_is_registered_only_where_a_source_must_turn_into_it(tmp_path: Path) -> None:
    garment, body = {"mesh": "g.ply"}, {"mesh": "b.ply"}
    assert "register_body" not in planned(tmp_path, garment=garment, body=body)
    both = planned(tmp_path, garment=garment, body=body, mannequin={"surface": "m.ply"})
    assert (
        both.index("register_mannequin") < both.index("register_body") < both.index("mesh.morph") < both.index("grade")
    )
    avatar = planned(tmp_path, garment=garment, body=body, mannequin={"avatar": "m.npz"})
    assert "register_mannequin" not in avatar
    assert "mesh.morph" in avatar
    assert "morph" in planned(tmp_path, garment=garment, body={"avatar": "b.npz"}, mannequin={"surface": "m.ply"})


@pytest.mark.parametrize("known", [False, True])
def test_the_body_ends_as_the_very_mesh_that_was_given(known: bool) -> None:
    body = named_pose(template(), "arms_down")
    given = TriangleMesh(body.vertices[::-1], len(body.vertices) - 1 - body.faces)  # the same surface, other vertices
    inputs: dict[str, object] = {"body_mesh": given}
    if known:
        inputs |= {"source_avatar": template(), "body_avatar": body}
    collider = MORPH.run(inputs, MORPH.settings(keyframes=4), Job())["collider"]
    assert len(collider.keyframes) == (4 if known else 1)
    assert_array_equal(collider.keyframes[-1], given.vertices)
    if known:
        assert np.abs(collider.keyframes[0][::-1] - template().vertices).max() < 1e-9


def test_a_body_mesh_of_another_axis_is_draped_upright() -> None:
    """Cloth falls along -Y: on a body with z up it would fall to the body's back."""
    body = named_pose(template(), "t_pose")
    lying = TriangleMesh(body.vertices[:, [0, 2, 1]] * [1, -1, 1], body.faces)  # (x, -z, y): z up, front -y
    job = Job()
    collider = MORPH.run({"body_mesh": lying}, MORPH.settings(keyframes=4), job)["collider"]
    assert_array_equal(collider.keyframes[-1], body.vertices)
    assert any("+Z of the body mesh is up" in note for note in job.notes)
