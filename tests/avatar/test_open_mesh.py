"""A garment that was given as a body is refused; bodies with holes, cut once or seen from one side are not."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from slow_cases import every

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.open_mesh import refuse_open_mesh
from vto_pipeline.avatar.scan.report import CUFFS, wide_openings
from vto_pipeline.bench.samples.garments.top import make_shirt
from vto_pipeline.bench.samples.garments.wearer import wearer
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import face_normals, submesh
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages import CATALOGUE

DATA = Path(__file__).parents[3] / "shared" / "data"
BODY = fit_measurements(Measurements({"stature": 1.78, "chest_girth": 1.02}, sex="male"))
PERSON = TriangleMesh(BODY.vertices, BODY.faces)
HEIGHT = PERSON.vertices[PERSON.faces].mean(axis=1)[:, 1] / np.ptp(PERSON.vertices[:, 1])


def with_holes(body: TriangleMesh, count: int) -> TriangleMesh:
    """Round holes of 10 cm, anywhere."""
    middle = body.vertices[body.faces].mean(axis=1)
    at = middle[np.random.default_rng(0).integers(0, len(middle), count)]
    away: NDArray[np.float64] = np.linalg.norm(middle[:, None] - at, axis=2).min(axis=1)
    return submesh(body, away > 0.05)[0]


def test_nothing_is_draped_on_a_garment() -> None:
    """By the row of the table that hands a body mesh to the drape."""
    row = next(stage for stage in CATALOGUE.stages if stage.name == "mesh.morph")
    with pytest.raises(AvatarError, match=r"looks like a garment.*open in 4 places"):
        row.run({"body_mesh": make_shirt(wearer("average")).mesh}, row.settings(), Job())


@pytest.mark.parametrize(
    "body",
    [
        with_holes(PERSON, 12),
        submesh(PERSON, face_normals(PERSON)[:, 2] > 0.0)[0],
        submesh(PERSON, (HEIGHT > 0.06) & (HEIGHT < 0.84))[0],  # no head, no feet
    ],
    ids=["holes", "front", "form"],
)
def test_a_body_with_openings_is_not(body: TriangleMesh) -> None:
    assert wide_openings(body) >= CUFFS
    refuse_open_mesh(body)


def test_what_is_closed_or_open_twice_may_have_any_shape() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.4)
    refuse_open_mesh(TriangleMesh(ball.vertices, ball.faces))
    refuse_open_mesh(TriangleMesh(ball.vertices, ball.faces[np.abs(ball.triangles_center[:, 1]) < 0.2]))


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the shared data are absent")
@pytest.mark.parametrize(("name", "openings"), [("tshirt.ply", 4), ("berkeley/pants/pants-iso.obj", 3)])
def test_a_garment_by_others_is_refused(name: str, openings: int) -> None:
    with pytest.raises(AvatarError, match=f"open in {openings} places"):
        refuse_open_mesh(read_mesh(DATA / "garments" / name))


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the shared data are absent")
@pytest.mark.parametrize("name", every(3, ["female_averageweight", "female_maxweight", "male_averageweight"]))
def test_a_body_by_others_with_holes_is_not(name: str) -> None:
    body = with_holes(read_mesh(DATA / "bodies" / f"mh_{name}.ply"), 12)
    assert wide_openings(body) >= CUFFS
    refuse_open_mesh(body)
