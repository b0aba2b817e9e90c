"""What is no body, or cannot be told from a garment, is refused; what people and dress forms are like is not."""

import numpy as np
import pytest
import trimesh

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.model.shape import SEX_SHARE, shape_space
from vto_pipeline.avatar.scan.report import refuse_garment, refuse_shape_of_no_body, report_registration
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.bench.samples.garments.top import make_shirt
from vto_pipeline.bench.samples.garments.wearer import wearer
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import face_normals, submesh
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

TRUNK_ENDS = ("head", "elbow", "wrist", "hip", "knee", "ankle")
SPACE = shape_space(SEX_SHARE["male"])
PERSON = fit_measurements(Measurements({"stature": 1.78, "chest_girth": 1.02}, sex="male"))


def cropped(kinds: tuple[str, ...]) -> TriangleMesh:
    """The person without what hangs on these joints: open where that was cut off, as a scan or a garment is."""
    joints = [k for k, kind in enumerate(JOINT_KINDS) if kind in kinds]
    off = PERSON.weights[:, joints].sum(axis=1) > 0.5
    left = trimesh.Trimesh(PERSON.vertices, PERSON.faces[~off[PERSON.faces].any(axis=1)])
    return TriangleMesh(left.vertices, left.faces)


def test_a_ball_is_not_a_body() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.6)
    with pytest.raises(AvatarError, match="not a body"):
        fit_scan(TriangleMesh(ball.vertices, ball.faces), ScanConfig(probes=500, iterations=5, rounds=1))


def test_a_box_of_a_persons_size_is_not_a_body() -> None:
    """As near as pose and build come to it: its own height, between its walls."""
    box = trimesh.creation.box((0.45, 1.7, 0.3)).subdivide().subdivide().subdivide()
    with pytest.raises(AvatarError, match="no build and pose"):
        fit_scan(TriangleMesh(box.vertices, box.faces), ScanConfig(probes=2000, iterations=8, rounds=1))


def test_a_tshirt_is_a_garment() -> None:
    """Fits the trunk of a body as well as many a scan of a person does."""
    someone = wearer("average")
    with pytest.raises(AvatarError, match="looks like a garment"):
        refuse_garment(make_shirt(someone).mesh, SPACE, someone.avatar.vertices)


def test_a_garment_whose_faces_are_turned_against_each_other_is_one_too() -> None:
    someone = wearer("average")
    shirt = make_shirt(someone).mesh
    faces = shirt.faces.copy()
    faces[::7] = faces[::7, ::-1]
    with pytest.raises(AvatarError, match="open in 4 places"):
        refuse_garment(TriangleMesh(shirt.vertices, faces), SPACE, someone.avatar.vertices)


@pytest.mark.parametrize("shown", ["head", "wrist", "ankle"])
def test_one_end_of_a_person_is_enough(shown: str) -> None:
    ends = tuple({"head", "wrist", "ankle"} - {shown})
    refuse_garment(cropped(ends), SPACE, PERSON.vertices)


def test_legs_are_enough() -> None:
    """An open dress form with thighs, as the one in test_avatar_scan."""
    refuse_garment(cropped(("head", "wrist", "ankle")), SPACE, PERSON.vertices)


def test_an_open_trunk_cannot_be_told_from_a_vest() -> None:
    with pytest.raises(AvatarError, match="open in 4 places"):
        refuse_garment(cropped(TRUNK_ENDS), SPACE, PERSON.vertices)


def test_a_dress_form_is_closed() -> None:
    """Cut at neck, arms and hip, each cut covered."""
    scan = cropped(TRUNK_ENDS)
    form = trimesh.Trimesh(scan.vertices, scan.faces)
    for loop in trimesh.graph.connected_components(form.edges[trimesh.grouping.group_rows(form.edges_sorted, 1)]):
        middle = len(form.vertices)
        rim = form.edges[trimesh.grouping.group_rows(form.edges_sorted, 1)]
        rim = rim[np.isin(rim[:, 0], loop)]
        cap = np.column_stack([rim[:, ::-1], np.full(len(rim), middle)])
        form = trimesh.Trimesh(
            np.vstack([form.vertices, form.vertices[loop].mean(axis=0)]), np.vstack([form.faces, cap]), process=False
        )
    assert form.is_watertight
    refuse_garment(TriangleMesh(form.vertices, form.faces), SPACE, PERSON.vertices)


def test_people_and_their_noise_are_like_a_body() -> None:
    """4 mm of noise, more than a depth camera leaves after fusion; then one a quarter wider than the model's body."""
    rough = PERSON.vertices + np.random.default_rng(3).normal(0, 0.004, PERSON.vertices.shape)
    refuse_shape_of_no_body(TriangleMesh(rough, PERSON.faces), SPACE, PERSON.vertices)
    apart = PERSON.vertices * [1.25, 1.0, 1.25]
    with pytest.raises(AvatarError, match="not a body"):
        refuse_shape_of_no_body(TriangleMesh(apart, PERSON.faces), SPACE, PERSON.vertices)


def test_the_likely_cause_is_named() -> None:
    """A woman in inches is read as 0.63 m; two people side by side are broader than anyone's reach."""
    apart = PERSON.vertices * [1.25, 1.0, 1.25]
    for vertices, faces, posed, cause in (
        (apart, PERSON.faces, PERSON.vertices, "clothed"),
        (0.4 * apart, PERSON.faces, PERSON.vertices, "unit: in"),
        (
            np.vstack([PERSON.vertices, PERSON.vertices + np.array([2.0, 0.0, 0.0])]),
            np.vstack([PERSON.faces, PERSON.faces + len(PERSON.vertices)]),
            apart,
            "what stands beside",
        ),
    ):
        with pytest.raises(AvatarError, match="not a body") as refused:
            refuse_shape_of_no_body(TriangleMesh(vertices, faces), SPACE, posed)
        assert cause in refused.value.hint


def test_a_trunk_seen_from_one_side_is_told() -> None:
    """Of a closed trunk about half faces each way; the rest is beyond 10 mm of it where the trunk is wide."""
    whole = TriangleMesh(PERSON.vertices, PERSON.faces)
    front, job = submesh(whole, face_normals(whole)[:, 2] > 0.0)[0], Job()
    hidden = report_registration(front, SPACE, PERSON.vertices, job)
    assert 0.35 < job.metrics["trunk_covered"] < 0.7
    assert hidden[0] == "part of the trunk not seen"
    assert any("of the trunk is in the scan" in warning for warning in job.warnings)
    job = Job()
    assert report_registration(whole, SPACE, PERSON.vertices, job) == []
    assert not job.warnings
