"""Seams that a file leaves open are sewn; real openings, and rims further apart, stay."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from vto_pipeline.garment import open_seams
from vto_pipeline.garment.open_seams import sew_open_seams
from vto_pipeline.geometry.remeshing.repair import RepairConfig, is_manifold, is_oriented, repair
from vto_pipeline.geometry.topology import boundary_loops, face_components
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages.garment import STAGES

SUIT = Path(__file__).parents[3] / "shared" / "data" / "garments" / "makehuman" / "male_worksuit01.obj"
EDGE, WITHIN = 0.01, 2e-3


def strip(columns, rows, shift=(0.0, 0.0, 0.0), edge=EDGE):
    x, y = np.meshgrid(edge * np.arange(columns + 1), edge * np.arange(rows + 1), indexing="ij")
    at = np.arange((columns + 1) * (rows + 1)).reshape(columns + 1, rows + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + shift
    return TriangleMesh(points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32))


def together(*meshes):
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, first, strict=False)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces).astype(np.int32))


def slit_tube(gap):
    """A tube of 40 edges around that is open along its length, by a gap [m]."""
    flat = strip(40, 12)
    turn = flat.vertices[:, 0] / (40 * EDGE) * 2.0 * np.pi
    radius = 40 * EDGE / (2.0 * np.pi)
    points = np.column_stack([radius * np.cos(turn), flat.vertices[:, 1], radius * np.sin(turn)])
    points[turn > 6.28, 2] -= gap
    return TriangleMesh(points, flat.faces)


def test_a_slit_tube_becomes_a_tube_whose_seam_lies_in_the_middle():
    job, slit = Job(), slit_tube(0.8e-3)
    assert len(boundary_loops(slit)) == 1
    sewn = sew_open_seams(slit, WITHIN, job)
    assert is_manifold(sewn)
    assert is_oriented(sewn)
    assert [len(loop) for loop in boundary_loops(sewn)] == [40, 40]
    assert len(sewn.vertices) == len(slit.vertices) - 13
    assert_allclose(np.sort(sewn.vertices[sewn.vertices[:, 0] > 0.0636, 2])[:13], -0.4e-3, atol=1e-12)
    assert_allclose(sewn.vertices[sewn.faces], slit.vertices[slit.faces], rtol=0, atol=0.41e-3)  # faces in their order
    assert "sewed 120 mm" in " ".join(job.notes)


def test_pieces_that_a_file_keeps_apart_become_one_whichever_lies_first():
    lower, upper = strip(10, 5), strip(4, 8, shift=(0.03, 0.05 + 0.6e-3, 0.5e-3))
    for parts in ((lower, upper), (upper, lower)):
        sewn = sew_open_seams(together(*parts), WITHIN, Job())
        assert face_components(sewn)[0] == 1
        assert len(boundary_loops(sewn)) == 1
        assert len(sewn.vertices) == len(lower.vertices) + len(upper.vertices) - 5


def test_colours_stay_with_their_vertices():
    lower, upper = strip(4, 2), strip(4, 2, shift=(0.0, 0.02 + 1e-3, 0.0))
    mesh = together(lower, upper)
    colors = np.random.default_rng(0).integers(0, 256, mesh.vertices.shape).astype(np.uint8)
    sewn = sew_open_seams(TriangleMesh(mesh.vertices, mesh.faces, colors), WITHIN, Job())
    far, which = cKDTree(mesh.vertices).query(sewn.vertices)
    assert (far == 0.0).sum() == 20
    assert_array_equal(sewn.colors[far == 0.0], colors[which[far == 0.0]])


@pytest.mark.parametrize(
    ("edge", "gap", "within"),
    [(EDGE, 3e-3, WITHIN), (3e-3, 1e-3, WITHIN), (EDGE, 0.5e-3, 0.0)],
    ids=["too far", "too far for its triangles", "not wanted"],
)
def test_other_rims_stay_apart(edge, gap, within):
    pair = together(strip(5, 5, edge=edge), strip(5, 5, shift=(0.0, 5 * edge + gap, 0.0), edge=edge))
    assert sew_open_seams(pair, within, Job()) is pair


def test_rims_of_layers_that_lie_on_each_other_are_no_seam():
    """They run the same way: sewn, the cloth would be folded flat onto itself all around."""
    pair = together(strip(5, 5), strip(5, 5, shift=(0.0, 0.0, 1e-3)))
    assert sew_open_seams(pair, WITHIN, Job()) is pair


def test_of_three_rims_at_one_place_two_are_sewn():
    lower, upper = strip(5, 5), strip(5, 5, shift=(0.0, 0.05 + 1e-3, 0.0))
    along, _, up = upper.vertices.T
    standing = TriangleMesh(np.column_stack([along, 0.0504 + up, 0.051 - upper.vertices[:, 1]]), upper.faces)
    for parts in permutations((lower, upper, standing)):
        sewn = sew_open_seams(together(*parts), WITHIN, Job())
        assert is_manifold(sewn)
        assert face_components(sewn)[0] == 2


def test_a_seam_that_would_leave_no_manifold_stays_open_and_is_said(monkeypatch):
    monkeypatch.setattr(open_seams, "is_manifold", lambda mesh: False)
    slit, job = slit_tube(0.8e-3), Job()
    assert sew_open_seams(slit, WITHIN, job) is slit
    assert "120 mm of rims" in job.warnings[0]
    assert "stay open" in job.warnings[0]


def test_a_lining_is_not_sewn_to_its_cloth_all_around():
    """Its rims run the other way, as those of a next piece do, but it lies on the same side: no opening would stay."""
    cloth, lining = slit_tube(0.0), slit_tube(0.0)
    pair = together(cloth, TriangleMesh(0.985 * lining.vertices + [0.0, 9e-4, 0.0], lining.faces[:, ::-1].copy()))
    sewn = sew_open_seams(pair, WITHIN, Job())
    assert face_components(sewn)[0] == 2
    assert len(boundary_loops(sewn)) == 4


@pytest.mark.parametrize(("pattern", "pieces"), [({}, 1), ({"garment_pattern": None}, 2)], ids=["mesh", "pattern"])
def test_a_mesh_is_sewn_where_it_is_taken_in_and_a_pattern_is_not(pattern, pieces):
    stage = next(stage for stage in STAGES if stage.name == "take_mesh")
    tube = slit_tube(0.0)
    gap = together(tube, TriangleMesh(tube.vertices + np.array([0.0, 0.1206, 0.0]), tube.faces))
    made = stage.run({"garment_mesh": gap, **pattern}, stage.settings(), Job())
    assert face_components(made["garment"])[0] == pieces


@pytest.mark.skipif(not SUIT.exists(), reason="needs garments by others")
def test_braces_that_end_on_the_back_hold_it():
    """Its back, 8 edges of it, is the only part held by nothing but vertices that lie 0.6 to 1.1 mm from others."""
    job = Job()
    suit = repair(read_mesh(SUIT, job=job), RepairConfig(), job)
    sewn = sew_open_seams(suit, WITHIN, job)
    assert is_manifold(sewn)
    assert face_components(sewn)[0] == face_components(suit)[0]
    large = [sum(len(loop) > 30 for loop in boundary_loops(mesh)) for mesh in (suit, sewn)]
    assert large[1] == large[0] + 2  # one rim all around becomes two armholes and a neck
