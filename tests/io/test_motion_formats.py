"""glTF animations, poses of the SMPL family and poses in YAML."""

from __future__ import annotations

import json
from base64 import b64encode
from pathlib import Path

import numpy as np
import pytest
from motion_shapes import NAMES, OFFSETS, PARENTS, random_moves
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import FormatError
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.io.bodies.skinned import read_skinned
from vto_pipeline.io.gltf.animate import animated_glb, write_glb_bytes
from vto_pipeline.io.motion.archive import read_avatar_motion, write_avatar_motion
from vto_pipeline.io.motion.gltf_animation import parse_animation
from vto_pipeline.io.motion.keyframes import parse_keyframes
from vto_pipeline.io.motion.read import presets, read_motion, understood
from vto_pipeline.io.motion.smpl_poses import parse_smpl_poses
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import AvatarMotion
from vto_pipeline.numerics.kinematics import quaternion_matrices, world_transforms

QUARTER = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
"""A quarter turn about z."""


def write_gltf(path: Path, nodes: list[dict], channels: list[tuple[int, str, str, list, list]], **more) -> Path:
    """Write a glTF by hand: nodes, and channels of node, path, interpolation, times and values."""
    blob = b""
    views, accessors = [], []

    def accessor(values) -> int:
        nonlocal blob
        array = np.array(values, dtype="<f4")
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        kind = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(array), "type": kind})
        blob += array.tobytes()
        return len(accessors) - 1

    samplers = [
        {"input": accessor(times), "output": accessor(values), "interpolation": kind}
        for _, _, kind, times, values in channels
    ]
    targets = [{"sampler": k, "target": {"node": node, "path": path}} for k, (node, path, *_) in enumerate(channels)]
    document = {
        "asset": {"version": "2.0"},
        "nodes": nodes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob), "uri": "data:;base64," + b64encode(blob).decode()}],
        "animations": [{"name": "a", "samplers": samplers, "channels": targets}],
        **more,
    }
    path.write_text(json.dumps(document))
    return path


CHAIN = [{"name": "a", "children": [1]}, {"name": "b", "translation": [0, 1, 0]}]


def turn_of(arrays, joint: int) -> np.ndarray:
    """Angle of a joint about z in each frame [deg]."""
    return Rotation.from_quat(arrays["rotations"][:, joint]).as_rotvec(degrees=True)[:, 2]


def test_the_three_interpolations_give_their_closed_forms(tmp_path):
    times = [0.0, 0.5, 1.0]
    still = [0.0, 0.0, 0.0, 1.0]
    fine = [k / 8 for k in range(9)]
    places = [[0.0, 1.0 + t, 0.0] for t in fine]
    found = {}
    for kind in ("LINEAR", "STEP", "CUBICSPLINE"):
        keys = [still, QUARTER, QUARTER]
        if kind == "CUBICSPLINE":
            keys = [row for key in keys for row in ([0.0] * 4, key, [0.0] * 4)]
        path = write_gltf(
            tmp_path / "a.gltf", CHAIN, [(0, "rotation", kind, times, keys), (1, "translation", "LINEAR", fine, places)]
        )
        found[kind] = parse_animation(str(path))
        assert found[kind]["frame_time"] == pytest.approx(1 / 10)  # ten frames a second are the least
    t = np.arange(11) / 10
    np.testing.assert_allclose(turn_of(found["LINEAR"], 0), np.minimum(180 * t, 90), rtol=0, atol=1e-4)  # float32 file
    np.testing.assert_allclose(turn_of(found["STEP"], 0), np.where(t >= 0.5, 90, 0), rtol=0, atol=1e-4)  # the same
    # without tangents the quaternion follows 3 s^2 - 2 s^3, and is then brought to unit length
    s = np.minimum(2 * t, 1.0)
    share = 3 * s**2 - 2 * s**3
    z, w = share * QUARTER[2], 1 - share + share * QUARTER[3]
    np.testing.assert_allclose(turn_of(found["CUBICSPLINE"], 0), np.rad2deg(2 * np.arctan2(z, w)), rtol=0, atol=1e-4)
    np.testing.assert_allclose(found["LINEAR"]["translations"][:, 1, 1], 1 + t, rtol=0, atol=1e-6)  # float32 file


def test_tangents_of_a_cubic_spline_are_per_second(tmp_path):
    times, seconds = [0.0, 4.0], 4.0
    keys = [[0, 0, 0], [0, 0, 0], [3, 0, 0], [0, 0, 0], [8, 0, 0], [0, 0, 0]]  # leaves at 3 m/s, arrives at rest
    fine = [k / 2 for k in range(9)]
    path = write_gltf(
        tmp_path / "a.gltf",
        CHAIN,
        [(0, "translation", "CUBICSPLINE", times, keys), (1, "translation", "LINEAR", fine, [[0, 1, 0]] * 9)],
    )
    x = parse_animation(str(path))["translations"][:, 0, 0]
    s = np.arange(len(x)) / 10 / seconds
    truth = seconds * 3 * (s**3 - 2 * s**2 + s) + 8 * (3 * s**2 - 2 * s**3)
    np.testing.assert_allclose(x, truth, rtol=0, atol=1e-5)  # single precision in the file


def person_gltf(path: Path, moves, scale: float) -> Path:
    """The person of `motion_shapes` under a node that scales and turns, as exporters write it."""
    nodes = [
        {
            "name": name,
            "translation": (OFFSETS[j] / scale).tolist(),
            "children": [k for k, p in enumerate(PARENTS) if p == j],
        }
        for j, name in enumerate(NAMES)
    ]
    for node in nodes:
        if not node["children"]:
            del node["children"]
    quarter_x = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    nodes.append({"name": "Armature", "children": [0], "scale": [scale] * 3, "rotation": quarter_x})
    times = [k / 30 for k in range(len(moves.turns))]
    channels = [
        (j, "rotation", "LINEAR", times, Rotation.from_matrix(moves.turns[:, j]).as_quat().tolist())
        for j in range(len(NAMES))
    ]
    channels.append((0, "translation", "LINEAR", times, (moves.root / scale).tolist()))
    return write_gltf(path, nodes, channels, skins=[{"joints": list(range(len(NAMES)))}])


def test_a_skin_under_a_node_that_scales_and_turns_stands_upright(tmp_path):
    moves = random_moves()
    path = person_gltf(tmp_path / "a.gltf", moves, 0.01)
    found = understood(parse_animation(str(path)), path, None, None, Job())
    assert (found.axes.unit, found.axes.up) == ("m", "+Z")
    assert found.joints.convention == "motionbuilder"
    _, places = world_transforms(found.clip.parents, quaternion_matrices(found.clip.rotations), found.clip.translations)
    order = [found.clip.joint_names.index(name) for name in NAMES]
    np.testing.assert_allclose(places[:, order], moves.places(), rtol=0, atol=1e-5)  # single precision in the file


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (
            {"animations": [{"channels": [{"sampler": 9, "target": {"node": 0, "path": "rotation"}}], "samplers": []}]},
            "no sampler 9",
        ),
        ({"nodes": [{"children": [1]}, {"children": [0]}]}, "loop"),
        ({"nodes": [{"children": [7]}]}, "child 7 does not exist"),
        ({"skins": [{"joints": [0, 5]}]}, "outside 0..1"),
        ({"nodes": [{"rotation": "up", "children": [1]}, {}]}, "cannot parse"),
    ],
)
def test_broken_animations_are_refused(tmp_path, change, problem):
    path = write_gltf(tmp_path / "a.gltf", CHAIN, [(0, "translation", "LINEAR", [0, 1], [[0, 0, 0]] * 2)])
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(FormatError, match=problem):
        parse_animation(str(path))


def test_times_that_fall_are_refused(tmp_path):
    path = write_gltf(tmp_path / "a.gltf", CHAIN, [(0, "translation", "LINEAR", [1, 0], [[0, 0, 0]] * 2)])
    with pytest.raises(FormatError, match="rising"):
        parse_animation(str(path))


def test_a_moving_avatar_comes_back_from_its_glb_and_its_archive(tmp_path):
    body = template(0.3)
    rng = np.random.default_rng(4)
    motion = AvatarMotion(
        body.joint_names,
        rng.uniform(-0.4, 0.4, (6, len(body.joints), 3)),
        rng.uniform(-0.3, 0.3, (6, 3)),
        rng.uniform(size=(6, 4)) > 0.5,
        1 / 24,
    )
    normals = vertex_normals(TriangleMesh(body.bind_vertices, body.faces))
    write_glb_bytes(tmp_path / "m.glb", animated_glb(body, normals, motion)[0])
    found = read_motion(tmp_path / "m.glb")
    assert found.joints.convention == "ours"
    resting = read_skinned(tmp_path / "m.glb")
    np.testing.assert_allclose(resting.vertices, body.bind_vertices, rtol=0, atol=1e-6)  # single precision in the file
    assert found.clip.frame_time == pytest.approx(1 / 24, rel=1e-6)
    _, places = world_transforms(found.clip.parents, quaternion_matrices(found.clip.rotations), found.clip.translations)
    order = [found.clip.joint_names.index(name) for name in body.joint_names]
    for t in range(6):
        rotation, offset = joint_transforms(body.joints, body.parents, motion.poses[t])
        truth = np.einsum("jab,jb->ja", rotation, body.joints) + offset + motion.translations[t]
        np.testing.assert_allclose(places[t, order], truth, rtol=0, atol=1e-5)  # single precision in the file
    write_avatar_motion(tmp_path / "m.npz", motion)
    again = read_avatar_motion(tmp_path / "m.npz")
    assert again.joint_names == motion.joint_names
    for name in ("poses", "translations", "planted"):
        np.testing.assert_array_equal(getattr(again, name), getattr(motion, name))
    np.savez(tmp_path / "bad.npz", poses=np.zeros((2, 3)))
    with pytest.raises(FormatError, match="missing"):
        read_avatar_motion(tmp_path / "bad.npz")


SMPL_PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
"""The first 22 of kintree_table in the published models."""


def test_poses_of_the_smpl_family_are_products_along_its_tree(tmp_path):
    rng = np.random.default_rng(8)
    poses = rng.uniform(-0.5, 0.5, (7, 156))
    places = rng.uniform(-1, 1, (7, 3))
    np.savez(tmp_path / "a.npz", poses=poses, trans=places, mocap_framerate=np.array(60.0), betas=np.zeros(16))
    arrays = parse_smpl_poses(str(tmp_path / "a.npz"))
    assert arrays["parents"].tolist() == SMPL_PARENTS
    assert arrays["frame_time"] == pytest.approx(1 / 60)
    turn, place = world_transforms(SMPL_PARENTS, quaternion_matrices(arrays["rotations"]), arrays["translations"])
    wrist, truth = 20, np.tile(np.eye(3), (7, 1, 1))
    for joint in (0, 3, 6, 9, 13, 16, 18, 20):  # pelvis, three of the spine, left collar, shoulder, elbow, wrist
        truth = truth @ Rotation.from_rotvec(poses[:, 3 * joint : 3 * joint + 3]).as_matrix()
    np.testing.assert_allclose(turn[:, wrist], truth, rtol=0, atol=1e-12)
    np.testing.assert_allclose(place[:, 0] - place[0, 0], places - places[0], rtol=0, atol=1e-12)


def test_z_up_of_amass_lost_frames_and_odd_shapes(tmp_path):
    poses = np.zeros((9, 66))
    poses[:, :3] = Rotation.from_euler("X", 90, degrees=True).as_rotvec()  # the T-pose of the model is y up
    poses[4] = np.nan
    np.savez(tmp_path / "a.npz", root_orient=poses[:, :3], pose_body=poses[:, 3:])
    job = Job()
    found = read_motion(tmp_path / "a.npz", job=job)
    assert found.axes.up == "+Z"
    assert any("1 lost frames" in text for text in job.warnings)
    assert any("no frame rate" in text for text in job.notes)
    for wrong in ({"poses": np.zeros((4, 65))}, {"trans": np.zeros((4, 3))}, {"poses": np.array(["a"])}):
        np.savez(tmp_path / "b.npz", **wrong)
        with pytest.raises(FormatError):
            parse_smpl_poses(str(tmp_path / "b.npz"))


def test_poses_in_yaml_hold_their_angles_at_their_times(tmp_path):
    (tmp_path / "a.yaml").write_text(
        "frames_per_second: 10\nposes:\n"
        "  - {at_s: 1, joints_deg: {left_elbow: [0, -20, 0]}}\n"
        "  - {at_s: 2, place_m: [0.1, 0.5], joints_deg: {left_elbow: [10, -90, 30]}}\n"
    )
    arrays = parse_keyframes(str(tmp_path / "a.yaml"))
    elbow = list(arrays["joint_names"]).index("left_elbow")
    turns = quaternion_matrices(arrays["rotations"][:, elbow])
    x, y, z = (
        Rotation.from_euler(axis, angle, degrees=True).as_matrix() for axis, angle in (("X", 10), ("Y", -90), ("Z", 30))
    )
    np.testing.assert_allclose(turns[-1], z @ y @ x, rtol=0, atol=1e-12)  # first x, then y, then z
    assert len(turns) == 11
    np.testing.assert_allclose(
        np.diff(arrays["translations"][[0, -1], 0, ::2], axis=0), [[0.1, 0.5]], rtol=0, atol=1e-12
    )
    for line, problem in (
        ("{at_s: 2, joints_deg: {tail: [0, 0, 0]}}", "expected one of pelvis"),
        ("{at_s: 0}", "times must rise"),
        ("{at_s: 2, joint_deg: {}}", "unknown key"),
        ("{at_s: 2, joints_deg: {head: [0, 999, 0]}}", "less than or equal"),
    ):
        (tmp_path / "b.yaml").write_text(f"poses:\n  - {{at_s: 1}}\n  - {line}\n")
        with pytest.raises(FormatError, match=problem) as raised:
            parse_keyframes(str(tmp_path / "b.yaml"))
        assert raised.value.where.endswith("line 3")


def test_every_preset_is_read():
    assert set(presets()) == {"t_pose", "a_pose", "arms_down", "arms_up", "sitting", "walking_step"}
    for path in presets().values():
        found = understood(parse_keyframes(str(path)), path, None, None, Job())
        assert found.axes.up == "+Y"
        assert len(found.joints.indices) == 21
