"""Registration: forms and bodies whose truth is known, and things that are no body."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from body_judges import crossing, distances
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.pose import pose_avatar
from vto_pipeline.errors import AvatarError
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

BODIES = Path(__file__).parents[3] / "shared" / "data" / "bodies"
YAW = 2.1


def true_body() -> Avatar:
    """A woman unlike the template, arms a little raised and bent."""
    tape = {"stature": 1.70, "chest_girth": 0.99, "waist_girth": 0.83, "hip_girth": 1.07}
    body = fit_measurements(Measurements(tape, sex="female"))
    pose = np.zeros((len(body.joints), 3))
    for joint, turn in {
        "left_shoulder": (0.1, 0, 0.12),
        "right_shoulder": (0.1, 0, -0.12),
        "left_elbow": (0, -0.2, 0),
    }.items():
        pose[body.joint_names.index(joint)] = turn
    return pose_avatar(body, pose, np.zeros(3))


def bumpy(mesh: trimesh.Trimesh, height: float) -> trimesh.Trimesh:
    """Smooth random bumps along the normals: ten of 5 to 12 cm width."""
    rng = np.random.default_rng(11)
    centers = mesh.vertices[rng.choice(len(mesh.vertices), 10, replace=False)]
    size = rng.uniform(0.05, 0.12, 10)
    distance = np.linalg.norm(mesh.vertices[:, None] - centers, axis=2)
    shift = height * (np.exp(-((distance / size) ** 2)) * rng.choice([-1, 1], 10)).sum(axis=1)
    return trimesh.Trimesh(mesh.vertices + shift[:, None] * mesh.vertex_normals, mesh.faces, process=False)


@pytest.fixture(scope="module")
def form() -> tuple[trimesh.Trimesh, Avatar, Avatar, Job]:
    """A dress form cut at neck, forearms and thighs, open, bumpy, turned; the truth; its registration."""
    body = true_body()
    whole = bumpy(trimesh.Trimesh(body.vertices, body.faces, process=False).subdivide(), 0.005)
    middle = whole.triangles_center
    forearm = body.vertices[body.loops["left_forearm"]].mean(axis=0)[0]
    kept = (middle[:, 1] < 1.44) & (middle[:, 1] > 0.62) & (np.abs(middle[:, 0]) < forearm)
    part = whole.submesh([kept], append=True)
    part.apply_transform(trimesh.transformations.rotation_matrix(YAW, [0, 1, 0]))
    part.apply_translation([0.4, -0.55, -0.2])
    job = Job()
    return part, body, fit_scan(TriangleMesh(part.vertices, part.faces), None, job), job


def test_form_is_found_and_met(form: tuple[trimesh.Trimesh, Avatar, Avatar, Job]) -> None:
    part, _, fitted, job = form
    away = distances(part.sample(4000, seed=5), fitted.vertices, fitted.faces)
    assert away.mean() < 1.5e-3
    assert np.quantile(away, 0.95) < 4e-3
    assert 0 < job.metrics["mean_mm"] < 1.5
    assert_allclose(job.metrics["mean_mm"] * 1e-3, away.mean(), rtol=0.3)  # probes instead of random points


def test_form_faces_the_right_way(form: tuple[trimesh.Trimesh, Avatar, Avatar, Job]) -> None:
    _, _, fitted, _ = form
    facing = Rotation.from_rotvec(fitted.pose[0].copy()).apply([0, 0, 1])
    assert facing @ [np.sin(YAW), 0, np.cos(YAW)] > 0.99  # within 8 degrees


def test_form_measures_as_the_truth(form: tuple[trimesh.Trimesh, Avatar, Avatar, Job]) -> None:
    _, body, fitted, _ = form
    true, got = measure(body).values, measure(fitted).values
    for name in ("chest_girth", "waist_girth", "hip_girth", "upper_arm_girth"):
        # the bumps of 5 mm are in the girths too
        assert_allclose(got[name], true[name], rtol=0, atol=15e-3, err_msg=name)


def test_registered_body_is_sound(form: tuple[trimesh.Trimesh, Avatar, Avatar, Job]) -> None:
    _, _, fitted, job = form
    assert trimesh.Trimesh(fitted.vertices, fitted.faces, process=False).is_watertight
    assert job.metrics["tangled_faces"] == 0
    assert not crossing(fitted.vertices, fitted.faces)
    again = pose_avatar(fitted, fitted.pose, fitted.translation)
    assert_allclose(again.vertices, fitted.vertices, rtol=0, atol=1e-12)
    assert abs(fitted.bind_vertices[:, 1].min()) < 1e-9


def test_a_ball_is_not_a_body() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.6)
    with pytest.raises(AvatarError, match="not a body"):
        fit_scan(TriangleMesh(ball.vertices, ball.faces), ScanConfig(probes=500, iterations=5, rounds=1))


def test_wrong_unit_is_told() -> None:
    body = true_body()
    with pytest.raises(AvatarError, match="1700"):
        fit_scan(TriangleMesh(body.vertices * 1000, body.faces))


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="shared data absent")
@pytest.mark.parametrize("name", ["mh_female_averageweight", "mh_female_maxweight", "mh_male_averageweight"])
def test_real_bodies(name: str) -> None:
    mesh = trimesh.load(BODIES / f"{name}.ply", process=False)
    job = Job()
    fitted = fit_scan(TriangleMesh(mesh.vertices, mesh.faces), None, job)
    assert job.metrics["core_mean_mm"] < 1.5
    assert job.metrics["core_p95_mm"] < 4
    assert job.metrics["tangled_faces"] == 0
    assert not crossing(fitted.vertices, fitted.faces)
