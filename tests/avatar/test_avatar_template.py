"""The template: sound, symmetric, of human size and weight."""

import numpy as np
import pytest
import trimesh
from body_judges import crossing, inside
from numpy.testing import assert_allclose

from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.model.shape import shape_space
from vto_pipeline.avatar.template.regions import trunk_vertices
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import InputError

# means of ANSUR II: stature, mass, chest, navel girth, hip, inside leg
ANSUR = {
    0.0: (1.6285, 67.8, 0.947, 0.861, 1.021, 0.782),
    1.0: (1.7562, 85.5, 1.059, 0.941, 1.020, 0.846),
}


@pytest.mark.parametrize("sex", [0.0, 0.5, 1.0])
def test_mesh_is_sound(sex: float) -> None:
    body = template(sex)
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.euler_number == 2
    assert 6_000 <= len(body.vertices) <= 12_000
    assert not crossing(body.vertices, body.faces)
    assert np.degrees(mesh.face_angles.min()) > 2


def test_left_mirrors_right_exactly() -> None:
    vertices = template(0.3).vertices
    mirrored = vertices * [-1, 1, 1]
    assert {tuple(p) for p in vertices} == {tuple(p + 0.0) for p in mirrored}


@pytest.mark.parametrize("sex", [0.0, 1.0])
def test_is_close_to_the_mean_of_ansur(sex: float) -> None:
    got = measure(template(sex)).values
    names = ("stature", "mass", "chest_girth", "navel_girth", "hip_girth", "inside_leg")
    assert_allclose([got[n] for n in names], ANSUR[sex], rtol=0.08, atol=0)  # hand-set sections: within 8 %


@pytest.mark.parametrize("sex", [0.0, 1.0])
@pytest.mark.parametrize("raised", [-0.12, -0.09, 0.06])
def test_a_low_crotch_folds_no_thighs(sex: float, raised: float) -> None:
    """Where a scan joins the thighs, the crotch comes to lie a hand's breadth lower than on others [m]."""
    space = shape_space(sex)
    parameters = np.where(np.array(space.names) == "crotch", raised, 0.0)
    vertices, at = space.vertices(parameters), space.base.landmarks["crotch_point"]
    assert_allclose(vertices[at, 1] - space.base.bind_vertices[at, 1], raised, rtol=0.1, atol=0)
    assert not crossing(vertices, space.base.faces)


def test_weights_and_skeleton() -> None:
    body = template(0.5)
    assert_allclose(body.weights.sum(axis=1), 1.0, rtol=0, atol=1e-12)  # rounding of one division
    assert body.weights.min() >= 0
    assert (body.parents < np.arange(len(body.parents))).all(), "parents come before their children"
    assert inside(body.joints, body.vertices, body.faces).all(), "every joint lies inside the body"


def test_loops_go_round_and_landmarks_lie_where_they_should() -> None:
    body = template(0.5)
    v, at = body.vertices, {name: body.vertices[i] for name, i in body.landmarks.items()}
    for name in ("hip", "navel", "waist", "underbust", "chest"):
        loop = body.loops[name]
        assert len(set(loop.tolist())) == len(loop)
        assert_allclose(v[loop, 1], v[loop[0], 1], rtol=0, atol=2e-6)  # stored in single precision
    assert at["crown"][1] == v[:, 1].max()
    assert at["left_bust_point"][2] > 0.1 > 0 > at["back_neck"][2]
    assert at["left_toe"][2] > at["left_heel"][2]
    assert at["left_wrist_point"][0] > 0 > at["right_wrist_point"][0]
    share = trunk_vertices(body).mean()
    assert 0.3 < share < 0.6


def test_sex_outside_its_range() -> None:
    with pytest.raises(InputError, match="sex is 1.5"):
        template(1.5)
