"""The place of a garment on a body it was never on: unit, axes, shift."""

from pathlib import Path

import numpy as np
import pytest
from cloth_scenes import moved, tube
from figures import figure, tunic
from numpy.testing import assert_allclose
from slow_cases import every

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.cloth.placement.orientation import as_files_have_it
from vto_pipeline.cloth.placement.place import PlaceConfig, find_placement
from vto_pipeline.cloth.placement.thinning import Thinning
from vto_pipeline.cloth.placement.voxel_fit import BodyCubes, quarter_turns
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

DATA = Path(__file__).parents[3] / "shared" / "data"
FINE = PlaceConfig(cube_mm=10)
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
DOWN = np.diag([-1.0, -1.0, 1.0])
AROUND = np.diag([-1.0, 1.0, -1.0])
SLOW = pytest.mark.slow  # the same on more garments and bodies


def spool():
    """A thick rod with a groove of radius 0.08 from y = 0.52 to 0.68."""
    mesh = tube(1.0, 1.0, 64, 101)
    y = mesh.vertices[:, 1]
    radius = np.where(np.abs(y - 0.6) < 0.08, 0.08, 0.15) * np.where((y < 1e-9) | (y > 1 - 1e-9), 1e-3, 1.0)
    return TriangleMesh(mesh.vertices * np.column_stack([radius, np.ones_like(y), radius]), mesh.faces)


def pear():
    """A rod that is wide below and narrow above."""
    mesh = tube(1.0, 1.0, 64, 101)
    y = mesh.vertices[:, 1]
    radius = (0.2 - 0.14 * y) * np.where((y < 1e-9) | (y > 1 - 1e-9), 1e-3, 1.0)
    return TriangleMesh(mesh.vertices * np.column_stack([radius, np.ones_like(y), radius]), mesh.faces)


def skirt():
    """A cone that the pear fills from 0.1 to 0.7, 12 mm about it."""
    mesh = tube(1.0, 0.6, 48, 31, base=0.1)
    radius = 0.212 - 0.14 * mesh.vertices[:, 1:2]
    return TriangleMesh(mesh.vertices * np.hstack([radius, np.ones_like(radius), radius]), mesh.faces)


@pytest.mark.parametrize("flip", [False, True])
def test_a_collar_goes_to_the_groove_it_was_made_for(flip):
    collar = tube(0.09, 0.1, 36, 8, base=0.55)
    strayed = moved(collar, 0.3, -0.2, 0.15)
    if flip:
        strayed = TriangleMesh(strayed.vertices, strayed.faces[:, ::-1])
    job = Job()
    found = find_placement(strayed, spool(), FINE, job).start_positions(strayed.vertices)
    assert_allclose(found[:, [0, 2]].mean(axis=0), 0.0, rtol=0, atol=0.012)  # one cube
    assert_allclose(found[:, 1].mean(), 0.6, rtol=0, atol=0.03)
    assert "garment moved by (-3" in job.notes[0]


def test_a_garment_wider_than_the_body_is_centred():
    hoop = moved(tube(0.165, 0.4, 48, 12, base=0.05), 0.25, 0.0, -0.4)
    found = find_placement(hoop, spool(), FINE, Job()).start_positions(hoop.vertices)
    assert_allclose(found[:, [0, 2]].mean(axis=0), 0.0, rtol=0, atol=0.015)  # what play there is, and one cube


def test_a_garment_that_stands_well_is_left_alone():
    collar = tube(0.09, 0.1, 36, 8, base=0.55)
    job = Job()
    assert_allclose(
        find_placement(collar, spool(), FINE, job).start_positions(collar.vertices), collar.vertices, rtol=0, atol=0
    )
    assert job.notes == ["garment left where it stands: its place scores 100% of the best"]


@pytest.mark.parametrize(
    ("unit", "metres", "turn"), [("m", 1.0, Z_UP), ("cm", 0.01, np.eye(3)), ("mm", 0.001, DOWN), ("in", 0.0254, DOWN)]
)
def test_unit_and_axes_are_found_and_told(unit, metres, turn):
    worn, job = skirt(), Job()
    strayed = TriangleMesh(worn.vertices @ turn / metres, worn.faces)
    placement = find_placement(strayed, pear(), PlaceConfig(cube_mm=20), job)
    found = placement.start_positions(strayed.vertices)
    assert_allclose(found[:, 1], worn.vertices[:, 1], rtol=0, atol=0.01)  # half a cube
    assert_allclose(found[:, [0, 2]].mean(axis=0), 0.0, rtol=0, atol=0.01)
    rest = placement.rest_positions(strayed.vertices)
    assert_allclose(np.ptp(rest, axis=0), np.ptp(worn.vertices, axis=0), rtol=1e-9)
    assert any(f"assumed to be in {unit}:" in note for note in job.notes) == (unit != "m")
    assert any(note.startswith("garment turned") for note in job.notes) == (turn[1, 1] != 1.0)


def test_a_garment_too_small_starts_around_the_body_and_that_is_told():
    rod, job = tube(0.15, 1.0, 64, 51), Job()
    rod = TriangleMesh(
        rod.vertices * np.where(np.abs(rod.vertices[:, 1:2] - 0.5) > 0.499, [1e-3, 1, 1e-3], 1.0), rod.faces
    )
    small = tube(0.12, 0.4, 48, 21, base=0.3)  # the rod is a quarter too thick
    placement = find_placement(small, rod, PlaceConfig(cube_mm=15), job)
    assert 1.2 <= placement.stretch <= 1.5
    start = TriangleMesh(placement.start_positions(small.vertices), small.faces)
    assert (SurfaceDistance(rod).signed(start.vertices).distance > -0.015).all()  # a cube
    assert_allclose(
        placement.rest_positions(small.vertices), small.vertices, rtol=0, atol=0
    )  # it is as small as before
    assert job.warnings[0].startswith("too small")


@pytest.mark.parametrize("turn", [np.eye(3), np.eye(3)[[0, 2, 1]]])
def test_a_flat_sheet_goes_around_nothing(turn):
    """Lying or standing; where it is asked to stay, it may."""
    step = np.linspace(0.0, 0.6, 13)
    x, z = np.meshgrid(step, step, indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    points = np.column_stack([x.ravel(), np.full(x.size, 0.9), z.ravel()]) @ turn.T
    flat = TriangleMesh(points, np.vstack([np.column_stack([a, c, b]), np.column_stack([a, d, c])]))
    with pytest.raises(InputError, match="goes around nothing"):
        find_placement(flat, tube(0.15, 1.0, 64, 51), PlaceConfig(), Job())
    assert find_placement(flat, tube(0.15, 1.0, 64, 51), PlaceConfig(place="as_it_stands"), Job()).scale == 1.0


def test_a_garment_of_no_size_is_refused():
    speck = TriangleMesh(1e-9 * skirt().vertices, skirt().faces)
    with pytest.raises(InputError, match="longest side is .*times the body"):
        find_placement(speck, pear(), FINE, Job())


def test_quarter_turns_are_the_rotations_of_a_cube_and_cubes_turn_like_meshes():
    turns = quarter_turns()
    assert len({tuple(turn.ravel()) for turn in turns}) == 24
    for turn in turns:
        assert_allclose(turn @ turn.T, np.eye(3), rtol=0, atol=0)
        assert np.linalg.det(turn) == pytest.approx(1.0)
    usual = [turn for turn in turns if as_files_have_it(turn)]
    assert_allclose(usual, [np.eye(3), Z_UP.T], rtol=0, atol=0)
    worn = moved(skirt(), 0.037, 0.0, 0.021)
    cubes = BodyCubes(pear(), 0.02, 2.0).fit(worn)
    for turn in turns[5::6]:
        found = cubes.best_placement(turn)
        turned = TriangleMesh(worn.vertices @ turn.T + found.shift, worn.faces)
        anew = BodyCubes(pear(), 0.02, 2.0).fit(turned).best_placement(np.eye(3))
        assert_allclose(anew.shift, 0.0, rtol=0, atol=0.021)  # a cube: the lattices differ by part of one
        assert_allclose(anew.score, found.score, rtol=0, atol=0.05)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize(
    ("name", "sex"),
    [
        ("blouse-short", "female"),
        ("pants", "female"),
        *(pytest.param(name, "male", marks=SLOW) for name in ("blouse-short", "vest", "skirt")),
    ],
)
def test_a_garment_that_fits_better_upside_down_is_not_put_on_so(name, sex):
    """Tight in the chest, a blouse is filled better by the hips, its sleeves beside them. z is up in the files."""
    garment = read_mesh(DATA / "garments" / "berkeley" / name / f"{name}-iso.obj")
    body = read_mesh(DATA / "bodies" / f"mh_{sex}_averageweight.ply")
    for mesh in (garment, remesh(garment, RemeshConfig(edge_mm=20), Job())):
        found = find_placement(mesh, body, PlaceConfig(), Job())
        assert_allclose(found.turn[1], [0.0, 0.0, 1.0], rtol=0, atol=0)
        assert found.scale == 1.0


def deeper(mesh, depth, front=1.0):
    """The mesh, so much deeper in front, or behind."""
    z = mesh.vertices[:, 2:]
    return TriangleMesh(
        mesh.vertices * np.hstack([np.ones((len(z), 2)), np.where(front * z > 0.0, depth, 1.0)]), mesh.faces
    )


@pytest.mark.parametrize("axes", [np.eye(3), Z_UP.T], ids=["y up, front +z", "z up, front -y"])
def test_what_the_file_calls_front_is_the_front_though_the_back_has_more_room_for_it(axes):
    body = deeper(pear(), 1.15)
    for front in (1.0, -1.0):
        worn = deeper(skirt(), 1.2, front)
        found = find_placement(TriangleMesh(worn.vertices @ axes, worn.faces), body, FINE, Job())
        assert_allclose(found.turn, axes, rtol=0, atol=0)


def test_a_garment_that_fits_far_better_the_other_way_round_is_turned_so():
    def leaning(mesh, way):
        x, y, z = mesh.vertices.T
        return TriangleMesh(np.column_stack([x, y, z + 0.6 * way * y**2]), mesh.faces)

    found = find_placement(leaning(skirt(), -1.0), leaning(pear(), 1.0), FINE, Job())
    assert_allclose(found.turn, np.diag([-1.0, 1.0, -1.0]), rtol=0, atol=0)


def test_a_loose_skirt_is_not_put_on_upside_down_though_the_body_fills_it_better_so():
    body, loose = pear(), tube(1.0, 0.3, 48, 21, base=0.3)
    radius = 0.17 + 0.03 * (loose.vertices[:, 1:2] - 0.3) / 0.3  # a little wider above, where the body is narrower
    worn = TriangleMesh(loose.vertices * np.hstack([radius, np.ones_like(radius), radius]), loose.faces)
    cubes = BodyCubes(body, 0.01, 2.0).fit(worn)
    down, up = (cubes.best_placement(turn).score for turn in (DOWN, np.eye(3)))
    assert up < 0.99 * down
    assert_allclose(find_placement(worn, body, FINE, Job()).turn, np.eye(3), rtol=0, atol=0)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize("name", every(2, ["tshirt", "blouse-short", "tank-male", "vest", "skirt", "pants"]))
@pytest.mark.parametrize("sex", ["female", pytest.param("male", marks=SLOW)])
def test_necklines_are_deeper_in_front(name, sex):
    """The files have z up, and the front at -y: there the necks of their tops are lower."""
    garment = read_mesh(DATA / "garments" / "berkeley" / name / f"{name}-iso.obj")
    found = find_placement(garment, read_mesh(DATA / "bodies" / f"mh_{sex}_averageweight.ply"), PlaceConfig(), Job())
    assert_allclose(found.turn, Z_UP.T, rtol=0, atol=0)


def test_a_garment_on_its_head_is_turned_where_that_fits_far_better():
    lying = TriangleMesh(skirt().vertices @ DOWN.T, skirt().faces)
    found = find_placement(lying, pear(), FINE, Job())
    assert_allclose(found.turn[1], [0.0, -1.0, 0.0], rtol=0, atol=0)


def test_a_tunic_on_its_head_is_turned_for_its_sleeves():
    body, worn = figure(0.3), tunic(0.3)
    lying = TriangleMesh(worn.vertices @ DOWN.T, worn.faces)
    assert_allclose(find_placement(lying, body, FINE, Job()).turn[1], [0.0, -1.0, 0.0], rtol=0, atol=0)
    assert_allclose(find_placement(worn, body, FINE, Job()).turn, np.eye(3), rtol=0, atol=0)


def test_a_tunic_back_to_front_is_turned_for_its_neckline():
    body, level = figure(0.3), tunic(0.3)
    neck = max(boundary_loops(level), key=lambda loop: level.vertices[loop, 1].mean())
    x = level.vertices.copy()
    x[neck, 1] -= np.tan(np.deg2rad(25.0)) * x[neck, 2]
    assert Thinning(body).neck_lean(TriangleMesh(x, level.faces)) == pytest.approx(np.deg2rad(25.0), abs=0.02)
    worn, back = TriangleMesh(x, level.faces), TriangleMesh(x @ AROUND.T, level.faces)
    assert_allclose(find_placement(worn, body, FINE, Job()).turn, np.eye(3), rtol=0, atol=0)
    assert_allclose(find_placement(back, body, FINE, Job()).turn, AROUND, rtol=0, atol=0)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize("sex", ["female", pytest.param("male", marks=SLOW)])
@pytest.mark.parametrize(
    "name", ["tshirt", *(pytest.param(one, marks=SLOW) for one in ("blouse-short", "tank-male", "dress3"))]
)
def test_real_garments_back_to_front_are_turned_for_their_necklines(name, sex):
    garment = read_mesh(DATA / "garments" / "berkeley" / name / f"{name}-iso.obj")
    person = read_mesh(DATA / "bodies" / f"mh_{sex}_averageweight.ply")
    back = TriangleMesh(garment.vertices @ Z_UP @ AROUND.T, garment.faces)
    assert_allclose(find_placement(back, person, PlaceConfig(), Job()).turn, AROUND, rtol=0, atol=0)
    facing_back = TriangleMesh(person.vertices @ AROUND.T, person.faces)
    assert_allclose(find_placement(back, facing_back, PlaceConfig(), Job()).turn, np.eye(3), rtol=0, atol=0)
    assert_allclose(find_placement(garment, facing_back, PlaceConfig(), Job()).turn, AROUND @ Z_UP.T, rtol=0, atol=0)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize(
    "body",
    ["female_averageweight", *(pytest.param(one, marks=SLOW) for one in ("female_maxweight", "male_averageweight"))],
)
@pytest.mark.parametrize("name", ["tshirt.ply", pytest.param("berkeley/dress2/dress2-iso.obj", marks=SLOW)])
def test_hips_fill_a_real_garment_on_its_head_as_well_but_its_sleeves_tell(name, body):
    person, garment = read_mesh(DATA / "bodies" / f"mh_{body}.ply"), read_mesh(DATA / "garments" / name)
    worn = find_placement(garment, person, PlaceConfig(), Job()).start_positions(garment.vertices)
    found = find_placement(TriangleMesh(worn @ DOWN.T, garment.faces), person, PlaceConfig(), Job())
    assert_allclose(found.turn[1], [0.0, -1.0, 0.0], rtol=0, atol=0)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize(
    "name", ["blouse-short", *(pytest.param(one, marks=SLOW) for one in ("tshirt", "vest", "tank-male", "dress3"))]
)
def test_necklines_go_about_the_nape(name):
    """Which is at 0.865 of the stature (ANSUR II). Hips fill a tight blouse better than the chest, its neck at the
    waist."""
    woman = fit_measurements(Measurements({"stature": 1.7, "bust_girth": 0.84, "hip_girth": 0.92}, sex="female")).mesh
    bodies = [woman, *(read_mesh(DATA / "bodies" / f"mh_{one}weight.ply") for one in ("female_average", "female_max"))]
    garment = remesh(
        read_mesh(DATA / "garments" / "berkeley" / name / f"{name}-iso.obj"), RemeshConfig(edge_mm=20), Job()
    )
    for body in bodies:
        found = find_placement(garment, body, PlaceConfig(), Job())
        top = found.start_positions(garment.vertices)[:, 1].max() - body.vertices[:, 1].min()
        assert top / np.ptp(body.vertices[:, 1]) == pytest.approx(0.865, abs=0.05)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
@pytest.mark.parametrize(
    ("sex", "stature", "chest", "hip"),
    [pytest.param("male", 1.82, 1.18, 1.16, marks=SLOW), ("female", 1.642, 0.929, 1.099)],
)
def test_a_skirt_too_small_for_the_hips_is_not_put_about_the_neck(sex, stature, chest, hip):
    """Heads fill it better. Waists are at 0.6 of the stature (ANSUR II: omphalion)."""
    tape = Measurements({"stature": stature, "chest_girth": chest, "hip_girth": hip}, sex=sex)
    body = fit_measurements(tape).mesh
    garment = remesh(
        read_mesh(DATA / "garments" / "berkeley" / "skirt" / "skirt-iso.obj"), RemeshConfig(edge_mm=20), Job()
    )
    found = find_placement(garment, body, PlaceConfig(), Job())
    top = found.start_positions(garment.vertices)[:, 1].max() - body.vertices[:, 1].min()
    assert top / np.ptp(body.vertices[:, 1]) == pytest.approx(0.6, abs=0.1)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
def test_a_garment_that_fewer_triangles_would_join_is_placed():
    """Decimated, this suit has an edge of three faces."""
    garment = read_mesh(DATA / "garments" / "makehuman" / "male_casualsuit01.obj")
    person = read_mesh(DATA / "bodies" / "mh_male_averageweight.ply")
    assert_allclose(find_placement(garment, person, PlaceConfig(), Job()).turn, np.eye(3), rtol=0, atol=0)


@pytest.mark.real_data
@pytest.mark.skipif(not DATA.exists(), reason="the data folder is absent")
def test_a_suit_too_small_is_not_put_on_upside_down():
    """In its own size a head fills it best, with arms and legs astray."""
    body = fit_measurements(Measurements({"stature": 1.78, "chest_girth": 1.16, "hip_girth": 1.12}, sex="male")).mesh
    whole = read_mesh(DATA / "garments" / "makehuman" / "female_elegantsuit01.obj")
    found = find_placement(repair(whole, RepairConfig(), Job()), body, PlaceConfig(), Job())
    assert_allclose(found.turn, np.eye(3), rtol=0, atol=0)
    assert found.stretch > 1.0
