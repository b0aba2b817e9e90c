"""A body mesh by others stands along +Y whatever its file calls up, and a facing other than +Z is told."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.standing import (
    refuse_misread_unit,
    stood_up,
    turn_of,
    warn_of_misread_unit,
    warn_of_several,
)
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh

BODIES = Path(__file__).parents[3] / "shared" / "data" / "bodies"
POSED = named_pose(template(), "t_pose")
BODY = TriangleMesh(POSED.vertices, POSED.faces)


def turned(body: TriangleMesh, axis: str, degrees: float) -> TriangleMesh:
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    return TriangleMesh(turn.apply(body.vertices.copy()), body.faces)


@pytest.mark.parametrize(("axis", "degrees", "up"), [("x", 90, "+Z"), ("x", -90, "-Z"), ("x", 180, "-Y")])
def test_the_body_is_turned_back(axis: str, degrees: float, up: str) -> None:
    job = Job()
    stands = stood_up(turned(BODY, axis, degrees), job)
    assert_allclose(stands.vertices, BODY.vertices, rtol=0, atol=1e-12)  # a quarter turn and its inverse: rounding
    assert any(note.startswith(up) for note in job.notes)
    assert not job.warnings


@pytest.mark.parametrize(("axis", "degrees", "up"), [("x", 90, "+Z"), ("x", -90, "-Z"), ("x", 0, "")])
def test_a_garment_turns_with_the_body_that_it_was_on(axis: str, degrees: float, up: str) -> None:
    job = Job()
    lying = turned(BODY, axis, degrees)
    assert_allclose(transform_mesh(lying, turn_of(lying, job)).vertices, BODY.vertices, rtol=0, atol=1e-12)
    assert [note[:2] for note in job.notes] == ([up] if up else [])


def test_what_stands_stays_as_it_is() -> None:
    job = Job()
    assert stood_up(BODY, job) is BODY
    slightly = turned(BODY, "y", 30)
    assert stood_up(slightly, job) is slightly
    assert not job.notes
    assert not job.warnings


@pytest.mark.parametrize(("degrees", "front"), [(180, "-Z"), (90, "+X"), (-90, "-X")])
def test_another_facing_is_told_and_kept(degrees: float, front: str) -> None:
    job = Job()
    away = turned(BODY, "y", degrees)
    assert stood_up(away, job) is away
    assert any(f"the body faces {front}" in warning for warning in job.warnings)


def scaled(body: TriangleMesh, factor: float) -> TriangleMesh:
    return TriangleMesh(factor * body.vertices, body.faces)


@pytest.mark.parametrize(
    ("unit", "read_as", "metres", "pose", "lying"),
    [
        ("inches", 0.01, 0.0254, "t_pose", 0.0),
        ("inches", 0.01, 0.0254, "a_pose", 90.0),
        ("feet", 0.1, 0.3048, "arms_down", 0.0),
    ],
)
def test_a_body_in_inches_or_feet_is_told_from_a_form(
    unit: str, read_as: float, metres: float, pose: str, lying: float
) -> None:
    posed = named_pose(template(), pose)
    body = turned(TriangleMesh(posed.vertices, posed.faces), "x", lying)
    stature = float(np.ptp(posed.vertices[:, 1]))
    with pytest.raises(AvatarError, match=f"{stature:.2f} m if the file is in {unit}"):
        refuse_misread_unit(scaled(body, read_as / metres))
    refuse_misread_unit(body)


@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="the shared data are absent")
@pytest.mark.parametrize("name", ["mh_female_maxweight", "mh_male_averageweight"])
def test_a_body_by_others_in_inches_is_told(name: str) -> None:
    body = read_mesh(BODIES / f"{name}.ply")
    with pytest.raises(AvatarError, match=f"{np.ptp(body.vertices[:, 1]):.2f} m if the file is in inches"):
        refuse_misread_unit(scaled(body, 0.01 / 0.0254))
    job = Job()  # half of its vertices are in face and hands
    warn_of_misread_unit(PointCloud(scaled(body, 0.01 / 0.0254).vertices), job)
    assert "if the file is in inches" in job.warnings[0]


def test_a_small_body_under_a_drape_is_warned_of() -> None:
    job = Job()
    stood_up(scaled(BODY, 0.4), job)
    assert "no one who stands is so small" in job.warnings[0]


@pytest.mark.parametrize(("low", "high"), [(0.42, 0.84), (0.42, 1.0), (0.0, 0.84)])
def test_a_form_or_a_part_of_a_body_may_be_small(low: float, high: float) -> None:
    height = (BODY.vertices[BODY.faces].mean(axis=1)[:, 1] - BODY.vertices[:, 1].min()) / np.ptp(BODY.vertices[:, 1])
    part = TriangleMesh(BODY.vertices, BODY.faces[(height > low) & (height < high)])
    used = TriangleMesh(
        BODY.vertices[np.unique(part.faces)], np.unique(part.faces, return_inverse=True)[1].reshape(-1, 3)
    )
    refuse_misread_unit(scaled(used, 0.4))


def test_what_is_no_body_stays_as_it_is() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.9)
    job = Job()
    given = TriangleMesh(ball.vertices, ball.faces)
    assert stood_up(given, job) is given
    assert not job.warnings


def test_two_bodies_are_told_and_one_in_pieces_is_not() -> None:
    count = len(BODY.vertices)

    def beside(shift: list[float]) -> list[str]:
        job = Job()
        both = np.vstack([BODY.vertices, BODY.vertices + shift]), np.vstack([BODY.faces, BODY.faces + count])
        warn_of_several(TriangleMesh(*both), job)
        return job.warnings

    assert "2 bodies stand beside" in beside([2.5, 0.0, 0.0])[0]
    assert "2 bodies stand beside" in beside([0.0, 0.0, 1.0])[0]
    assert not beside([0.01, 0.0, 0.01])  # one layer of skin over another
    legs = [trimesh.creation.cylinder(0.08, 0.8) for _ in range(2)]
    trunk = trimesh.creation.cylinder(0.2, 0.9)
    for part, place in ((trunk, [0, 0, 1.25]), (legs[0], [0.12, 0, 0.4]), (legs[1], [-0.12, 0, 0.4])):
        part.apply_translation(place)
    whole = trimesh.util.concatenate([trunk, *legs])
    job = Job()
    warn_of_several(TriangleMesh(whole.vertices[:, [0, 2, 1]], whole.faces[:, ::-1]), job)
    assert not job.warnings


@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="bodies by others are not here")
@pytest.mark.parametrize("name", ["female_averageweight", "female_maxweight", "male_averageweight"])
def test_bodies_by_others_are_told_front_from_back(name: str) -> None:
    body = read_mesh(BODIES / f"mh_{name}.ply")
    job = Job()
    assert stood_up(body, job) is body
    assert not job.warnings
    stood_up(turned(body, "y", 180), job)
    assert "the body faces -Z" in job.warnings[0]


@pytest.mark.parametrize(("times", "said"), [(0.4, "if the file is in inches"), (2.54, "no one is so tall"), (1.0, "")])
def test_a_cloud_or_mesh_of_a_persons_wrong_size_is_told(times: float, said: str) -> None:
    """Inches read as centimetres, and the other way round; the size is the ratio's of the two units."""
    body = scaled(BODY, times)
    for what in (body, PointCloud(body.vertices)):
        job = Job()
        warn_of_misread_unit(what, job)
        assert [said in text and f"{np.ptp(body.vertices[:, 1]):.2f} m" in text for text in job.warnings] == [True] * (
            times != 1.0
        )
