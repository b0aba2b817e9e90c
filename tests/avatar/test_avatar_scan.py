"""Registration: forms and bodies whose truth is known, and things that are no body."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from body_judges import crossing, distances, independent_girth
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.measuring.measuring_levels import find_levels, with_rows_at_levels
from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.model.shape import shape_space
from vto_pipeline.avatar.model.stance import ARM, stance
from vto_pipeline.avatar.scan.bind_pose import to_bind_pose
from vto_pipeline.avatar.scan.initial_pose import upright_initial_poses
from vto_pipeline.avatar.scan.upright import candidate_up_rotations, in_metres, inside_out, without_floor
from vto_pipeline.avatar.template.template import beyond_armscye, membership
from vto_pipeline.bench.body.people import poor_scan, random_body
from vto_pipeline.bench.samples.customer import CELL, SHAPE
from vto_pipeline.bench.samples.solids.body import body_distance
from vto_pipeline.bench.samples.solids.surface_nets import zero_surface
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.topology import face_normals
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.scan.normals import oriented_normals
from vto_pipeline.scan.surface import SurfaceConfig, reconstruct_cloud

BODIES = Path(__file__).parents[3] / "shared" / "data" / "bodies"
YAW = 2.1
TRUNK = ("chest", "underbust", "waist", "navel", "hip")
QUICK = ScanConfig(probes=2000, iterations=12)


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


def girths_at_levels(fitted: Avatar, truth: np.ndarray, faces: np.ndarray) -> dict[str, float]:
    """What our tape reads less an independent slice of the truth at the same height [m]."""
    read = measure(fitted).values
    ahead = truth @ Rotation.from_rotvec(fitted.pose[0].copy()).as_matrix()  # so that arms lie beside the trunk in x
    middle = float(np.median(ahead[:, 0]))
    wrong = {}
    for row in TRUNK:
        height = float(fitted.vertices[fitted.loops[row], 1].mean())
        wrong[row] = read[f"{row}_girth"] - independent_girth(ahead, faces, height, middle)
    return wrong


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
    return part, body, fit_scan(TriangleMesh(part.vertices, part.faces), QUICK, job), job


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


def test_form_measures_as_a_slice(form: tuple[trimesh.Trimesh, Avatar, Avatar, Job]) -> None:
    part, _, fitted, _ = form
    wrong = girths_at_levels(fitted, part.vertices, part.faces)
    assert max(map(abs, wrong.values())) < 4e-3, wrong


def test_registered_body_is_sound(form: tuple[trimesh.Trimesh, Avatar, Avatar, Job]) -> None:
    _, _, fitted, job = form
    assert trimesh.Trimesh(fitted.vertices, fitted.faces, process=False).is_watertight
    assert job.metrics["tangled_faces"] == 0
    assert not crossing(fitted.vertices, fitted.faces)
    again = pose_avatar(fitted, fitted.pose, fitted.translation)
    assert_allclose(again.vertices, fitted.vertices, rtol=0, atol=1e-12)
    assert abs(fitted.bind_vertices[:, 1].min()) < 1e-9


def test_a_size_of_no_unit_is_told() -> None:
    body = true_body()
    with pytest.raises(AvatarError, match="no unit of"):
        fit_scan(TriangleMesh(body.vertices * 17, body.faces))


def test_units_axes_and_floors_are_found_out() -> None:
    """Closed form: what was done to the body is undone exactly."""
    body = true_body().mesh
    floor = trimesh.creation.box((1.2, 0.01, 1.2), trimesh.transformations.translation_matrix((0, -0.006, 0)))
    whole = trimesh.util.concatenate([trimesh.Trimesh(body.vertices, body.faces, process=False), floor])
    for name, turn in candidate_up_rotations(body).items():
        job = Job()
        found = in_metres(TriangleMesh(1000.0 * whole.vertices @ turn, whole.faces), job)
        assert any("millimetres" in note for note in job.notes)
        assert any("were dropped" in note for note in job.notes)
        assert len(found.faces) == len(body.faces), "the floor is gone, the body is whole"
        stands, _ = upright_initial_poses(found, job)
        assert_allclose(stands.vertices, body.vertices, rtol=0, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("part", ["whole", "front", "trunk", "on a floor"])
def test_what_is_inside_out_is_seen(part: str) -> None:
    """Whatever is open, and though a one-sided floor's own flux is many times the body's."""
    body = true_body().mesh
    vertices, faces, middle = body.vertices, body.faces, body.vertices[body.faces].mean(axis=1)
    if part == "front":
        faces = faces[face_normals(body)[:, 2] > 0]
    elif part == "trunk":
        faces = faces[(middle[:, 1] > 0.8) & (middle[:, 1] < 1.4)]
    elif part == "on a floor":
        corners = np.array([[-3, -0.002, -3], [-3, 0, 3], [3, 0, 3], [3, 0.002, -3]])  # nearly level
        floor = len(vertices) + np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
        vertices, faces = np.concatenate([vertices, corners]), np.concatenate([faces, floor])
    assert not inside_out(TriangleMesh(vertices, faces))
    assert inside_out(TriangleMesh(vertices, faces[:, ::-1]))


def test_what_is_inside_out_is_turned_over() -> None:
    """It is again the mesh that faced outwards, bit for bit, and told; what faced outwards stays."""
    body = true_body().mesh
    told, untold = Job(), Job()
    turned, _ = upright_initial_poses(TriangleMesh(body.vertices, body.faces[:, ::-1]), told)
    kept, _ = upright_initial_poses(body, untold)
    for found in (turned, kept):
        assert_array_equal(found.vertices, body.vertices)
        assert_array_equal(found.faces, body.faces)
    assert any("inside out" in note for note in told.notes)
    assert not any("inside out" in note for note in untold.notes)


@pytest.mark.slow
def test_the_fit_of_what_is_inside_out_is_that_of_the_body() -> None:
    body = true_body().mesh
    job = Job()
    fitted = fit_scan(body, QUICK, Job())
    other = fit_scan(TriangleMesh(body.vertices, body.faces[:, ::-1]), QUICK, job)
    assert_array_equal(other.vertices, fitted.vertices)
    assert measure(other) == measure(fitted)
    assert any("inside out" in note for note in job.notes)


def test_a_floor_grown_together_with_the_feet_is_cut() -> None:
    body = true_body()
    sunk = trimesh.creation.box((1.2, 0.02, 1.2), trimesh.transformations.translation_matrix((0, 0.002, 0)))
    joined = trimesh.boolean.union([trimesh.Trimesh(body.vertices, body.faces, process=False), sunk])
    kept = without_floor(TriangleMesh(joined.vertices, joined.faces))
    assert np.ptp(kept.vertices[:, [0, 2]], axis=0)[1] < 0.5, "nothing of the plate's 1.2 m is left"
    assert kept.vertices[:, 1].min() < 0.03, "the feet are"
    alone = without_floor(body.mesh)
    assert len(alone.faces) == len(body.faces), "soles are no floor"


def test_levels_are_the_extremes_of_slices() -> None:
    """Against brute force by trimesh: the narrowest slice, the most rearward point."""
    body = true_body()
    found = find_levels(body.bind_vertices, body)
    heights = {row: body.bind_vertices[body.loops[row], 1].mean() for row in ("waist", "hip")}
    near = heights["waist"] + np.arange(-0.045, 0.045, 0.001)
    girths = [independent_girth(body.bind_vertices, body.faces, y, 0.0) for y in near]
    if "waist" in found:
        assert_allclose(
            independent_girth(body.bind_vertices, body.faces, found["waist"], 0.0),
            min(girths),
            rtol=0,
            atol=1e-3,  # a parabola over 56 mm instead of the one narrowest slice
        )
    assert abs(found["hip"] - heights["hip"]) < 0.05
    trunk = membership("arm") < 0.5
    band = trunk & (np.abs(body.bind_vertices[:, 1] - heights["hip"]) < 0.05)
    back = body.bind_vertices[band]
    at_level = np.abs(back[:, 1] - found["hip"]) < 0.012
    assert back[at_level, 2].min() < back[:, 2].min() + 1e-3


def test_levels_of_a_small_child() -> None:
    """A similar body has its levels at the same shares of its height; the ankle's reach ends below the floor."""
    body = true_body()
    share = 0.45
    floor = body.bind_vertices[:, 1].min()
    tall, small = (
        find_levels(body.bind_vertices - [0, floor, 0], body),
        find_levels(share * (body.bind_vertices - [0, floor, 0]), body),
    )
    assert {"knee", "ankle", "hip"} <= small.keys() & tall.keys()
    for row in small.keys() & tall.keys():
        assert_allclose(small[row], share * tall[row], rtol=0, atol=0.005, err_msg=row)


def test_rows_come_to_their_levels() -> None:
    space = shape_space(0.0)
    zero = np.zeros(len(space.names))
    bind = space.vertices(zero)
    level = {row: float(bind[space.base.loops[row], 1].mean()) for row in ("waist", "chest", "hip", "neck_base")}
    wanted = {"waist": level["waist"] + 0.02, "chest": level["chest"] - 0.01}
    slid = with_rows_at_levels(space, zero, bind, wanted)
    moved = slid.vertices(zero)
    for row, height in wanted.items():
        assert_allclose(moved[space.base.loops[row], 1].mean(), height, rtol=0, atol=1e-3)
    assert_allclose(moved[space.base.loops["neck_base"], 1], bind[space.base.loops["neck_base"], 1], rtol=0, atol=2e-3)
    assert_allclose(moved[:, [0, 2]], bind[:, [0, 2]], rtol=0, atol=1e-12)
    assert not crossing(moved, space.base.faces)


def test_posture_stays_and_arms_do_not() -> None:
    """A body that stands keeps its trunk and legs as bind pose; posed again, it is where the scan was."""
    space = shape_space(0.0)
    names = space.base.joint_names
    pose = np.zeros((len(names), 3))
    pose[0] = [0.0, 1.0, 0.0]
    for joint, turn in {"chest": (0.1, 0, 0), "left_hip": (0, 0, 0.1), "left_shoulder": (0, 0, 0.15)}.items():
        pose[names.index(joint)] = turn
    fit = Fit(np.zeros(len(space.names)), pose, np.array([0.3, 0.1, -0.2]), np.zeros(len(space.names)))
    posed = posed_vertices(space, fit)
    stands = stance(space, fit)
    body, tangled = to_bind_pose(space, fit, stands, posed, posed)
    assert stands.stands
    assert tangled == 0
    assert_allclose(body.vertices, posed, rtol=0, atol=1e-9)
    assert_allclose(body.pose[names.index("chest")], 0.0, rtol=0, atol=1e-12)
    own = space.base.weights[:, [k for k, n in enumerate(names) if n.rpartition("_")[2] in ARM]].sum(axis=1) == 0
    turned = (posed[own] - posed[own][0]) @ stands.yaw
    assert_allclose(body.bind_vertices[own] - body.bind_vertices[own][0], turned, rtol=0, atol=1e-9)
    arm = body.joints[names.index("left_wrist")] - body.joints[names.index("left_shoulder")]
    rest = space.base.joints[names.index("left_wrist")] - space.base.joints[names.index("left_shoulder")]
    assert_allclose(arm, rest, rtol=0, atol=1e-12)


def test_a_crouch_is_told() -> None:
    space = shape_space(1.0)
    names = space.base.joint_names
    pose = np.zeros((len(names), 3))
    for side in ("left", "right"):
        pose[names.index(f"{side}_hip")] = [-1.2, 0.0, 0.0]
    fit = Fit(np.zeros(len(space.names)), pose, np.zeros(3), np.zeros(len(space.names)))
    found = stance(space, fit)
    assert not found.stands
    assert_allclose(found.lean, 1.2, rtol=0, atol=1e-9)
    assert_allclose(found.pose, pose, rtol=0, atol=0)


@pytest.mark.slow
@pytest.mark.parametrize(("sex", "seed"), [("female", 0), ("male", 1), ("female", 2), ("male", 3)])
def test_own_bodies_are_found_again(sex: str, seed: int) -> None:
    """20,000 points, 2 mm noise, 5 % outliers, 10 % holes; random shape, stance and facing."""
    body = random_body(sex, seed)
    scan = reconstruct_cloud(poor_scan(body, seed), SurfaceConfig(), Job())
    fitted = fit_scan(scan, ScanConfig(sex=sex))
    on_body, face = trimesh.sample.sample_surface(trimesh.Trimesh(body.vertices, body.faces), 6000, seed=1)
    ends = [k for k, name in enumerate(body.joint_names) if name.rpartition("_")[2] in ("head", "wrist", "ankle")]
    core = body.weights[:, ends].sum(axis=1)[body.faces[face]].mean(axis=1) < 0.3
    away = distances(on_body[core], fitted.vertices, fitted.faces)
    assert 0.2e-3 < away.mean() < 1.0e-3
    assert np.quantile(away, 0.95) < 2.5e-3
    trunk = body.faces[~beyond_armscye()[body.faces].any(axis=1)]  # some stand with their arms on the chest
    read = measure(fitted).values
    wrong = {
        row: read[f"{row}_girth"]
        - independent_girth(body.vertices, trunk, float(fitted.vertices[fitted.loops[row], 1].mean()), None)
        for row in TRUNK
    }
    assert max(map(abs, wrong.values())) < 3e-3, wrong


@pytest.mark.slow
@pytest.mark.parametrize(("stature", "wide"), [(1.64, 1.0), (1.60, 1.12), (1.76, 0.95)])
def test_joined_thighs(stature: float, wide: float) -> None:
    """Implicit solids whose thighs are one down to 38 % of the stature, where ours part at 48 %."""
    shape = replace(SHAPE, stature=stature, widths=tuple(wide * np.array(SHAPE.widths)))
    low, high = np.array([-0.85, -0.04, -0.27]), np.array([0.85, stature + 0.04, 0.27])
    solid, job = zero_surface(lambda points: body_distance(shape, points), low, high, CELL), Job()
    fitted = fit_scan(TriangleMesh(solid.vertices, solid.faces), None, job)
    x, y, _ = np.abs(solid.vertices.T)
    core = (y > 0.10 * stature) & (y < 0.80 * stature) & (x < 0.27)  # feet, head and hands are not ours
    away = distances(solid.vertices[core], fitted.vertices, fitted.faces)
    assert away.mean() < 1.5e-3
    assert np.quantile(away, 0.95) < 4e-3
    assert job.metrics["tangled_faces"] == 0
    assert not crossing(fitted.vertices, fitted.faces)


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
    wrong = girths_at_levels(fitted, mesh.vertices, mesh.faces)
    assert max(abs(wrong[row]) for row in ("underbust", "waist", "navel", "hip")) < 4e-3, wrong
    # a bare nipple is narrower than an edge of ours: one vertex stands on it, and a slice that hits it is longer still
    assert abs(wrong["chest"]) < 6e-3


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="shared data absent")
def test_facing_unit_axis_and_floor_do_not_matter() -> None:
    mesh = trimesh.load(BODIES / "mh_female_averageweight.ply", process=False)
    plain = measure(fit_scan(TriangleMesh(mesh.vertices, mesh.faces))).values
    low = float(mesh.vertices[:, 1].min())
    plate = trimesh.creation.box((1.5, 0.02, 1.5), trimesh.transformations.translation_matrix((0, low - 0.011, 0)))
    other = trimesh.util.concatenate([mesh, plate])
    other.apply_transform(trimesh.transformations.rotation_matrix(1.3, [0, 1, 0]))
    other.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    again = measure(fit_scan(TriangleMesh(1000.0 * other.vertices, other.faces))).values
    for name in plain:
        if name.endswith("_girth"):
            assert_allclose(again[name], plain[name], rtol=0, atol=1e-3, err_msg=name)


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="shared data absent")
def test_a_quarter_of_the_faces_will_do() -> None:
    """The levels come from smoothed profiles, so that fewer facets do not move the tape."""
    mesh = trimesh.load(BODIES / "mh_female_averageweight.ply", process=False)
    whole = TriangleMesh(mesh.vertices, mesh.faces)
    plain = measure(fit_scan(whole)).values
    coarse = measure(fit_scan(decimate(whole, len(whole.faces) // 4, aggressiveness=5.0))).values
    for row in (*TRUNK, "neck", "upper_arm", "forearm", "wrist", "thigh"):
        assert_allclose(coarse[f"{row}_girth"], plain[f"{row}_girth"], rtol=0, atol=1e-3, err_msg=row)


def test_normals_of_a_drawn_person_point_out() -> None:
    """Of one whose cloud is a fifth inside out when signs are spread along a tree."""
    body = random_body("female", 168)
    points = poor_scan(body, 168).points
    face, _, away = closest_points(points, body.vertices, body.faces)
    near = away < 0.006  # three times the noise; the rest are outliers
    normals = oriented_normals(PointCloud(points), 20, Job())
    against = (normals * face_normals(body.mesh)[face]).sum(axis=1) < 0
    assert against[near].mean() < 0.02


@pytest.mark.slow
def test_a_leg_that_is_inside_out_is_told() -> None:
    """Nothing of the body is drawn to a surface that faces the other way: its knee came out 7 cm too large."""
    body = true_body()
    names = [f"left_{joint}" for joint in ("hip", "knee", "ankle")]
    own = np.isin(body.weights.argmax(axis=1), [body.joint_names.index(name) for name in names])
    faces = body.faces.copy()
    over = own[faces].all(axis=1)
    faces[over] = faces[over][:, ::-1]
    with pytest.raises(AvatarError, match="left leg is inside out"):
        fit_scan(TriangleMesh(body.vertices, faces), QUICK)
