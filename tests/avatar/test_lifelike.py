"""Face, fingers and toes on the avatar: the same girths, nothing that crosses, the same pose."""

from __future__ import annotations

from functools import cache

import igl
import numpy as np
import pytest
import trimesh
from lifelike_data import data
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.lifelike.graft import Seat, beyond, fit_part, strip
from vto_pipeline.avatar.lifelike.lifelike import LifelikeConfig, lifelike_body
from vto_pipeline.avatar.lifelike.phenotype import TARGETS, shares
from vto_pipeline.avatar.model.pose import named_pose, pose_avatar
from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.template.template import template
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, submesh, vertex_normals
from vto_pipeline.io.bodies.avatars import read_lifelike, write_lifelike
from vto_pipeline.io.bodies.makehuman_library import read_library
from vto_pipeline.model.body import Avatar, LifelikeBody, Measurements, MorphableBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.clear_body import outside
from vto_pipeline.render.tuck import tuck

PEOPLE = {
    "woman": ("female", {"stature": 1.66, "mass": 60.0}, 25.0),
    "man": ("male", {"stature": 1.78, "mass": 78.0}, 40.0),
    "heavy": ("male", {"stature": 1.76, "mass": 140.0}, 50.0),
    "old": ("female", {"stature": 1.55, "mass": 44.0}, 80.0),
    "child": ("male", {"stature": 1.35, "mass": 35.0}, 9.0),
}


@cache
def library() -> MorphableBody:
    return read_library(data())


@cache
def person(name: str) -> tuple[Avatar, LifelikeBody]:
    sex, tape, age = PEOPLE[name]
    avatar = fit_measurements(Measurements(tape, sex=sex))
    return avatar, lifelike_body(avatar, library(), LifelikeConfig(age_years=age), Job())


@pytest.mark.parametrize("age", [1.0, 7.0, 10.0, 40.0, 90.0, 99.0])
@pytest.mark.parametrize("mass_index", [12.0, 20.0, 30.0, 60.0])
def test_shares_of_a_person_are_one_person(age: float, mass_index: float) -> None:
    """Each kind of target has shares that sum to one, and those of its sex, age and build the middle that was asked."""
    found = shares(0.3, age, mass_index)
    assert set(found) <= set(TARGETS)
    for kind in ("universal", "african"):
        own = {name.split("-")[1]: 0.0 for name in found}
        for name, share in found.items():
            if name.startswith(kind):
                own[name.split("-")[1]] += share * (1 if kind == "universal" else 3)
        assert own == pytest.approx({"female": 0.7, "male": 0.3}, abs=1e-12)  # sums of a few products
    ages = {"baby": 1.0, "child": 10.0, "young": 25.0, "old": 90.0}
    shown = sum(share * ages[name.split("-")[2]] for name, share in found.items() if name.startswith("universal"))
    assert shown == pytest.approx(min(age, 90.0), abs=1e-9)  # linear between the data's ages


def grafted(part_sex: float, lift: float) -> tuple[TriangleMesh, TriangleMesh, TriangleMesh]:
    """A woman's body, its trunk without a head, and the head of another body on it."""
    woman, other = template(0.0), template(part_sex)
    body = TriangleMesh(woman.bind_vertices, woman.faces)
    crown = woman.landmarks["crown"]
    seat = Seat(woman.loops["neck"], crown, np.array([0.0, 1.0, 0.0]), 0.05)
    shift = woman.bind_vertices[woman.loops["head"]].mean(axis=0) - other.bind_vertices[other.loops["head"]].mean(
        axis=0
    )
    part = TriangleMesh(other.bind_vertices + shift + [0.0, lift, 0.0], other.faces)
    head = fit_part(body, seat, part, crown).mesh
    trunk, source = submesh(body, ~beyond(body, seat)[body.faces].any(axis=1))
    rim, other_rim = boundary_loops(trunk)[0], max(boundary_loops(head), key=len)
    closing = strip(np.concatenate([trunk.vertices, head.vertices]), rim, other_rim + len(source), seat.axis)
    faces = np.concatenate([trunk.faces, head.faces + np.int32(len(source)), closing])
    return body, trunk, TriangleMesh(np.concatenate([trunk.vertices, head.vertices]), faces)


@pytest.mark.parametrize("lift", [-0.01, 0.0, 0.012])
def test_another_head_closes_the_body_without_a_crossing(lift: float) -> None:
    """By trimesh it is one closed surface, turned outwards; by exact signs nothing meets; the trunk is as it was."""
    body, trunk, whole = grafted(1.0, lift)
    found = trimesh.Trimesh(whole.vertices, whole.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert 0.95 * volume(body) < found.volume < 1.1 * volume(body)
    assert len(self_intersections(whole)) == 0
    assert np.isin(trunk.vertices, body.vertices).all()


def test_its_own_head_comes_back_as_it_was() -> None:
    """A body's head on the same body: next to the row, and everywhere else, the surface is the old one."""
    body, _, whole = grafted(0.0, 0.0)
    squared, _, _ = igl.point_mesh_squared_distance(whole.vertices, body.vertices, body.faces.astype(np.int64))
    assert np.sqrt(squared.max()) < 5e-4  # chords of a surface of 8 mm triangles
    assert volume(whole) == pytest.approx(volume(body), rel=1e-4)


def volume(mesh: TriangleMesh) -> float:
    return float(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume)


def girth(mesh: TriangleMesh, row: np.ndarray, body: Avatar, normal: np.ndarray, shift: float) -> float:
    """Convex hull of the section through a row's middle, nearest to it, by trimesh."""
    middle = body.bind_vertices[row].mean(axis=0) + shift * normal
    found = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).section(normal, middle)
    assert found is not None
    curves = [np.asarray(curve) for curve in found.discrete]
    nearest = min(curves, key=lambda curve: np.linalg.norm(curve.mean(axis=0) - middle))
    return float(ConvexHull(nearest @ np.linalg.svd(normal[None])[2][1:].T).area)


@pytest.mark.parametrize("name", PEOPLE)
def test_girths_are_the_avatars(name: str) -> None:
    """At every row from head to ankle, and 8 mm inside those of neck, wrist and ankle, within a millimetre."""
    avatar, body = person(name)
    plain, rest = (TriangleMesh(one.bind_vertices, one.faces) for one in (avatar, body.avatar))
    up = np.array([0.0, 1.0, 0.0])
    arm = avatar.joints[avatar.joint_names.index("left_wrist")] - avatar.joints[avatar.joint_names.index("left_elbow")]
    arm /= np.linalg.norm(arm)
    rows = [
        (row, up, 0.0) for row in ("head", "neck_base", "chest", "waist", "hip", "left_thigh", "left_knee", "left_calf")
    ]
    rows += [("neck", up, 0.0), ("neck", up, -0.008), ("left_ankle", up, 0.0), ("left_ankle", up, 0.008)]
    rows += [("left_forearm", arm, 0.0), ("left_wrist", arm, 0.0), ("left_wrist", arm, -0.008)]
    for row, normal, shift in rows:
        before, after = (girth(mesh, avatar.loops[row], avatar, normal, shift) for mesh in (plain, rest))
        assert after == pytest.approx(before, abs=1e-3), row
    assert np.ptp(rest.vertices[:, 1]) == pytest.approx(np.ptp(plain.vertices[:, 1]), abs=1e-3)  # stature


@pytest.mark.parametrize("name", PEOPLE)
def test_it_is_closed_and_nothing_crosses(name: str) -> None:
    _, body = person(name)
    found = trimesh.Trimesh(body.mesh.vertices, body.mesh.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert len(self_intersections(body.mesh)) == 0
    assert len(trimesh.graph.connected_components(found.face_adjacency)) == 3  # a body and two eyes


@pytest.mark.parametrize("name", PEOPLE)
def test_it_has_fingers_toes_and_a_face(name: str) -> None:
    """Planes cut four fingers and five toes apart; the nose is what is furthest ahead of a head, above the chin."""
    avatar, body = person(name)
    rest = trimesh.Trimesh(body.avatar.bind_vertices, body.avatar.faces, process=False)
    wrist, tip = avatar.bind_vertices[avatar.loops["left_wrist"]].mean(axis=0), avatar.landmarks["left_fingertip"]
    along = avatar.bind_vertices[tip] - wrist
    fingers = rest.section(along / np.linalg.norm(along), wrist + 0.7 * along)
    assert sum(np.linalg.norm(curve.mean(axis=0) - wrist) < 0.25 for curve in fingers.discrete) == 4
    toe, heel = (avatar.bind_vertices[avatar.landmarks[f"left_{one}"]] for one in ("toe", "heel"))
    most = 0
    for share in np.linspace(0.8, 0.97, 18):
        toes = rest.section([0.0, 0.0, 1.0], heel + share * (toe - heel))
        near = [c for c in toes.discrete if c[:, 1].max() < 0.06 and np.linalg.norm(c.mean(axis=0) - toe) < 0.2]
        most = max(most, len(near))
    assert most >= 3  # of five, as their tips lie on an arc
    neck, crown = avatar.bind_vertices[avatar.loops["neck"], 1].mean(), rest.vertices[:, 1].max()
    head = rest.vertices[rest.vertices[:, 1] > neck]
    nose = head[np.argmax(head[:, 2])]
    assert abs(nose[0]) < 0.02
    assert 0.2 < (nose[1] - neck) / (crown - neck) < 0.6


def test_it_moves_as_the_avatar_does() -> None:
    """In a pose, trunk and limbs are the avatar's."""
    avatar, body = person("woman")
    posed = named_pose(avatar, "sitting")
    ours = pose_avatar(body.avatar, posed.pose, posed.translation)
    kept = np.isin(body.avatar.bind_vertices, avatar.bind_vertices).all(axis=1)
    assert kept.mean() > 0.4
    where = {point.tobytes(): k for k, point in enumerate(avatar.bind_vertices)}
    source = [where[point.tobytes()] for point in np.ascontiguousarray(body.avatar.bind_vertices[kept])]
    np.testing.assert_allclose(ours.vertices[kept], posed.vertices[source], rtol=0, atol=1e-12)  # the same sums


def test_a_hand_and_a_head_turn_with_their_joints() -> None:
    """A fingertip goes where the wrist's motion takes it, and the nose where the head's does."""
    avatar, body = person("woman")
    pose = np.zeros((len(avatar.joint_names), 3))
    for joint, turn in {"left_elbow": (0.3, 0.0, 0.4), "left_wrist": (0.5, 0.2, 0.6), "head": (0.4, 0.3, 0.0)}.items():
        pose[avatar.joint_names.index(joint)] = turn
    rotation, offset = joint_transforms(avatar.joints, avatar.parents, pose)
    moved, rest = pose_avatar(body.avatar, pose, np.zeros(3)).vertices, body.avatar.bind_vertices
    high = np.where(rest[:, 1] > avatar.bind_vertices[avatar.loops["head"], 1].mean() - 0.1, rest[:, 2], -1.0)
    for joint, vertex in (("left_wrist", np.argmax(rest[:, 0])), ("head", np.argmax(high))):
        k = avatar.joint_names.index(joint)
        np.testing.assert_allclose(moved[vertex], rotation[k] @ rest[vertex] + offset[k], rtol=0, atol=1e-9)  # rounding


@pytest.mark.parametrize("name", ["woman", "heavy"])
def test_ears_lie_under_a_hood_and_fingers_in_a_sleeve(name: str) -> None:
    """Cloth 5 mm off the avatar's skull and left hand: nothing of the lifelike body beneath it stands out."""
    avatar, body = person(name)
    plain = avatar.mesh
    wrist, neck = avatar.joint_names.index("left_wrist"), avatar.vertices[avatar.loops["neck"], 1].mean()
    front = avatar.vertices[avatar.loops["head"], 2].max()
    skull = (avatar.vertices[:, 1] > neck + 0.03) & (avatar.vertices[:, 2] < front - 0.05)
    worn = skull | (avatar.weights[:, wrist] > 0.5)
    cloth, _ = submesh(
        TriangleMesh(plain.vertices + 0.005 * vertex_normals(plain), plain.faces), worn[plain.faces].all(axis=1)
    )
    tucked = tuck(body.mesh, plain, [cloth])
    assert (SurfaceDistance(body.mesh).signed(cloth.vertices).distance < 0).sum() > 20  # ears and fingers did stand out
    assert (SurfaceDistance(tucked).signed(cloth.vertices).distance > 0).all()
    (cleared,) = outside([cloth], tucked)
    assert np.linalg.norm(cleared - cloth.vertices, axis=1).max() == 0.0
    nose = int(np.argmax(np.where(body.mesh.vertices[:, 1] > neck, body.mesh.vertices[:, 2], -1.0)))
    assert np.array_equal(tucked.vertices[nose], body.mesh.vertices[nose])  # the face is bare


def test_its_file_gives_it_back(tmp_path) -> None:  # type: ignore[no-untyped-def]
    _, body = person("child")
    write_lifelike(tmp_path / "lifelike.npz", body)
    again = read_lifelike(tmp_path / "lifelike.npz")
    assert np.array_equal(again.colors, body.colors)
    assert np.array_equal(again.avatar.vertices, body.avatar.vertices)


def test_skin_and_hair_are_as_asked() -> None:
    avatar, _ = person("man")
    bald = lifelike_body(avatar, library(), LifelikeConfig(skin=(90, 60, 45), hair=None), Job())
    crown = int(np.argmax(bald.avatar.bind_vertices[:, 1]))
    assert bald.colors[crown].tolist() == [90, 60, 45]
    dark = lifelike_body(avatar, library(), LifelikeConfig(hair=(10, 10, 10)), Job())
    assert dark.colors[crown].tolist() == [10, 10, 10]
