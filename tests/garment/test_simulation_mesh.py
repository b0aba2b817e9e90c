"""Any mesh becomes one that can be simulated: what is kept, what is mended, what is dropped, and that it is said."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.garment.simulation_mesh import SimulationMeshConfig, least_angles, remesh_for_simulation
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import (
    boundary_loops,
    edge_face_counts,
    edge_faces,
    edges,
    face_components,
)
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, LENGTH, EDGE = 0.10, 0.3, 15.0
CONFIG = SimulationMeshConfig(edge_mm=EDGE)


def tube(around=60, along=30, shift=0.0):
    """An open tube, edges of 10 mm, that lies in (x, 0, z) = (shift, ..., 0)."""
    turn, up = np.meshgrid(2.0 * np.pi * np.arange(around) / around, np.linspace(0.0, LENGTH, along), indexing="ij")
    vertices = np.stack([RADIUS * np.sin(turn) + shift, up, RADIUS * np.cos(turn)], axis=-1).reshape(-1, 3)
    at = np.arange(around * along).reshape(around, along)
    on = np.roll(at, -1, axis=0)
    a, b, c, d = at[:, :-1].ravel(), on[:, :-1].ravel(), on[:, 1:].ravel(), at[:, 1:].ravel()
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def together(*meshes):
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, first, strict=False)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def with_flaps(mesh, count):
    """Triangles that stand off from inner edges, which so have three faces."""
    ends = edges(mesh)[edge_faces(mesh)[:, 1] >= 0][:: len(mesh.faces) // count][:count]
    tips = mesh.vertices[ends].mean(axis=1) * [1.05, 1.0, 1.05]
    flaps = np.column_stack([ends, len(mesh.vertices) + np.arange(count)])
    return TriangleMesh(np.vstack([mesh.vertices, tips]), np.vstack([mesh.faces, flaps]))


def broken(how):
    mesh = tube()
    if how == "soup":
        return TriangleMesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    if how == "100 edges of three faces":
        return with_flaps(mesh, 100)
    if how == "doubled faces":
        return TriangleMesh(mesh.vertices, np.vstack([mesh.faces, mesh.faces[:, ::-1]]))
    if how == "turned faces":
        turn = np.random.default_rng(3).random(len(mesh.faces)) < 0.5
        return TriangleMesh(mesh.vertices, np.where(turn[:, None], mesh.faces[:, ::-1], mesh.faces))
    if how == "vertices on each other":
        moved, inner = mesh.vertices.copy(), np.arange(35, 1700, 90)
        moved[inner] = moved[inner + 1]
        return TriangleMesh(moved, mesh.faces)
    if how == "a button":
        ball = trimesh.creation.icosphere(subdivisions=1, radius=0.004)
        return together(mesh, TriangleMesh(ball.vertices + np.array([0.12, 0.1, 0.0]), ball.faces))
    if how == "a thick button":  # of more area than four squares, but no larger than two of them side by side
        ring = trimesh.creation.torus(0.014, 0.005)
        return together(mesh, TriangleMesh(ring.vertices + np.array([0.12, 0.1, 0.0]), ring.faces))
    return mesh


CASES = {
    "nothing": [],
    "soup": ["welded"],
    "100 edges of three faces": ["cut non-manifold", "dropped 100 of 101 pieces"],
    "doubled faces": ["duplicate faces"],
    "turned faces": ["to agree with their neighbours"],
    "vertices on each other": ["welded", "degenerate faces"],
    "a button": ["dropped 1 of 2 pieces"],
    "a thick button": ["dropped 1 of 2 pieces"],
}


@pytest.mark.parametrize("how", CASES)
def test_a_tube_comes_out_as_a_tube_whatever_was_wrong_with_it(how):
    from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair

    mesh, job = broken(how), Job()
    if how == "100 edges of three faces":
        assert (edge_face_counts(mesh)[1] == 3).sum() == 100
    made = remesh_for_simulation(repair(mesh, RepairConfig(), job), CONFIG, job)
    assert is_manifold(made)
    assert face_components(made)[0] == 1
    rims = [perimeter(made, loop) for loop in boundary_loops(made)]
    assert_allclose(rims, [2.0 * np.pi * RADIUS] * 2, rtol=0.03)  # a 60-gon, its chords cut by 15 mm edges
    area = trimesh.Trimesh(made.vertices, made.faces, process=False).area
    assert_allclose(area, 2.0 * np.pi * RADIUS * LENGTH, rtol=0.02)  # the same
    assert_allclose(1e3 * np.median(edge_lengths(made)), EDGE, rtol=0.1)
    assert np.rad2deg(least_angles(made.vertices[made.faces]).min()) > 15.0
    off = SurfaceDistance(tube()).nearest(made.vertices).distance
    assert off.max() < 2e-3  # a pinched row of the broken tube is 0.5 mm off; chords sag 0.3 mm
    told = " ".join(job.notes)
    assert all(words in told for words in CASES[how])


def test_faces_that_run_against_each_other_are_turned_before_remeshing():
    job = Job()
    made = remesh_for_simulation(broken("turned faces"), CONFIG, job)
    assert len(boundary_loops(made)) == 2
    assert_allclose(len(made.faces), len(remesh_for_simulation(tube(), CONFIG, Job()).faces), rtol=0.02)
    assert any("to agree with their neighbours" in text for text in job.notes)


def test_each_of_several_pieces_is_kept_and_treated_for_itself():
    even = remesh_for_simulation(tube(), CONFIG, Job())
    job, loose = Job(), SimulationMeshConfig(edge_mm=EDGE, least_angle_deg=10)
    both = remesh_for_simulation(together(tube(shift=0.5), even), loose, job)
    assert face_components(both)[0] == 2
    assert len(boundary_loops(both)) == 4
    assert_allclose(both.vertices[-len(even.vertices) :], even.vertices, rtol=0, atol=0)  # good enough: as it was
    assert [what for what, _ in job.left_out] == ["remeshing"]
    assert both.vertices[: -len(even.vertices), 0].min() > 0.3


def test_a_strap_keeps_its_width_with_finer_triangles():
    rows = np.linspace(0.0, 0.4, 41)
    left, right = (np.column_stack([np.full(41, x), rows, np.zeros(41)]) for x in (0.0, 0.02))
    at = np.arange(40)
    faces = np.vstack([np.column_stack([at, at + 41, at + 42]), np.column_stack([at, at + 42, at + 1])])
    job = Job()
    made = remesh_for_simulation(TriangleMesh(np.vstack([left, right]), faces), CONFIG, job)
    assert any("narrow" in note for note in job.notes)
    assert 4.0 < 1e3 * np.median(edge_lengths(made)) < 9.0  # a third of 20 mm
    assert_allclose(trimesh.Trimesh(made.vertices, made.faces, process=False).area, 0.4 * 0.02, rtol=0.05)
    assert np.ptp(made.vertices[:, 0]) > 0.018


def test_all_good_pieces_are_left_as_they_are():
    even = remesh_for_simulation(tube(), CONFIG, Job())
    loose = SimulationMeshConfig(edge_mm=EDGE, least_angle_deg=10)
    pair = together(even, TriangleMesh(even.vertices + np.array([0.5, 0.0, 0.0]), even.faces))
    job = Job()
    assert remesh_for_simulation(pair, loose, job) is pair
    assert all("used as it is" in why for _, why in job.left_out)
    assert remesh_for_simulation(pair, loose, Job(force_all=True)) is not pair


def with_eyelet(mesh, around):
    """The mesh without the faces about a few of its vertices, so with a hole about as long around as wanted [m]."""
    middle = np.linalg.norm(mesh.vertices - mesh.vertices.mean(axis=0) - [0, 0, 0.1], axis=1).argmin()
    near = np.linalg.norm(mesh.vertices - mesh.vertices[middle], axis=1) < around / (2 * np.pi)
    return TriangleMesh(mesh.vertices, mesh.faces[~near[mesh.faces].any(axis=1)])


def test_an_eyelet_is_filled_and_a_sleeve_is_not():
    job = Job()
    fine = tube(around=300, along=150)
    made = remesh_for_simulation(with_eyelet(fine, 0.018), CONFIG, job)
    assert len(boundary_loops(made)) == 2
    assert any(note.startswith("filled 1 openings of ") for note in job.notes)
    assert len(boundary_loops(remesh_for_simulation(with_eyelet(fine, 0.15), CONFIG, Job()))) == 3


def test_the_only_opening_is_never_filled():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    pouch = with_eyelet(TriangleMesh(ball.vertices, ball.faces), 0.02)
    job = Job()
    made = remesh_for_simulation(pouch, SimulationMeshConfig(edge_mm=20.0), job)
    assert len(boundary_loops(made)) == 1
    assert not [note for note in job.notes if note.startswith("filled")]


def test_an_opening_that_no_edges_can_follow_is_named():
    def toothed(deep):
        """A tube with a rim of 60 teeth, some of the vertices of which are raised."""
        mesh = tube(around=120, along=60)
        vertices = mesh.vertices.copy()
        rim = np.flatnonzero(vertices[:, 1] == vertices[:, 1].max())
        vertices[rim[::2], 1] += deep
        return TriangleMesh(vertices, mesh.faces)

    for deep, named in ((0.0, False), (6e-3, True)):
        job = Job()
        mesh = toothed(deep)
        made = remesh_for_simulation(mesh, CONFIG, job)
        before, after = (max(perimeter(m, loop) for loop in boundary_loops(m)) for m in (mesh, made))
        assert (abs(after / before - 1.0) > 0.02) == named
        assert any("an opening is" in text for text in job.warnings) == named


def folded(gap, width=0.3, arm=0.12, fine=0.008):
    """A sheet folded by 180 degrees, its halves this far apart [m]."""
    r = 0.5 * gap
    s = np.arange(0.0, 2.0 * arm + np.pi * r, fine)
    turn = np.clip((s - arm) / r, 0.0, np.pi)
    y = np.minimum(s, arm) + r * np.sin(turn) - np.maximum(s - arm - np.pi * r, 0.0)
    x = np.arange(0.0, width, fine)
    vertices = np.stack(np.broadcast_arrays(x[None], y[:, None], r * np.cos(turn)[:, None]), axis=-1).reshape(-1, 3)
    at = np.arange(len(s) * len(x)).reshape(len(s), len(x))
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, d]), np.column_stack([b, c, d])]).astype(np.int32))


def rolled(pitch, width=0.2, turns=3.0, fine=0.008):
    """A sheet rolled up, its layers this far apart [m]: each lies between two that face as it does."""
    turn = np.arange(0.0, 2.0 * np.pi * turns, fine / 0.03)
    x = np.arange(0.0, width, fine)
    radius = 0.03 + pitch * turn / (2.0 * np.pi)
    around = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    vertices = np.stack(np.broadcast_arrays(x[None], around[:, :1], around[:, 1:]), axis=-1).reshape(-1, 3)
    at = np.arange(len(turn) * len(x)).reshape(len(turn), len(x))
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, d]), np.column_stack([b, c, d])]).astype(np.int32))


@pytest.mark.parametrize(
    ("sheet", "edge_mm"),
    [(folded(0.02), 10.0), (folded(0.02), 20.0), (folded(0.003), 12.0), (folded(0.0015), 15.0), (rolled(0.003), 20.0)],
    ids=["wide", "wide_coarse", "tight", "tightest", "rolled"],
)
def test_it_warns_exactly_where_layers_that_lay_apart_cross(sheet, edge_mm, request):
    """In a fold they face opposite ways and are told apart; what is rolled up lies beside what faces alike."""
    job = Job()
    made = remesh_for_simulation(sheet, SimulationMeshConfig(edge_mm=edge_mm), job)
    assert len(self_intersections(sheet)) == 0
    crossed = len(self_intersections(made))
    warned = [text for text in job.warnings if "pairs of triangles cross" in text]
    assert len(warned) == (crossed > 0)
    assert (crossed > 0) == ("rolled" in request.node.name)
    assert not crossed or f"{crossed} pairs" in warned[0]


@pytest.mark.parametrize("gap", [0.02, 0.003])
def test_it_warns_exactly_where_folds_are_cut_short(gap):
    sheet, job = folded(gap), Job()
    made = remesh_for_simulation(sheet, SimulationMeshConfig(edge_mm=20.0), job)
    before, after = (trimesh.Trimesh(m.vertices, m.faces, process=False).area for m in (sheet, made))
    lost = 1.0 - after / before
    assert (lost > 0.15) == (gap < 0.01)
    warned = [text for text in job.warnings if "cloth short" in text]
    assert len(warned) == (gap < 0.01)
    assert not warned or f"cut {lost:.0%}" in warned[0]


def test_what_was_sewn_is_judged_in_its_panels():
    """Bent in space its triangles are sharper, and other ones would lie across the seams; slivers go all the same."""
    flat = tube()
    laid = np.zeros((len(flat.faces), 3, 2)) + EDGE * 1e-3 * np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.8]])
    bent = TriangleMesh(flat.vertices * [1.0, 0.5, 1.0], flat.faces)
    config = SimulationMeshConfig(edge_mm=1e3 * float(np.median(edge_lengths(bent))), least_angle_deg=30.0)
    assert np.rad2deg(least_angles(bent.vertices[bent.faces]).min()) < 30.0
    assert remesh_for_simulation(bent, config, Job()) is not bent
    assert remesh_for_simulation(bent, config, Job(), laid) is bent
    sharp = laid * [1.0, 0.1]
    assert remesh_for_simulation(bent, config, Job(), sharp) is not bent
