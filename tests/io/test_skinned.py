"""Bodies with a skeleton: files written here, by NumPy, pygltflib and as text; the truth is what was written."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from io_shapes import capsule
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.bodies.makehuman import parse_makehuman
from vto_pipeline.io.bodies.skinned import read_skinned
from vto_pipeline.io.bodies.smpl import parse_smpl
from vto_pipeline.io.gltf.read import parse_gltf
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.io.sniff import find_kind
from vto_pipeline.model.body import SkinnedBody


class Payload:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return Path.touch, (self.path,)


def body() -> SkinnedBody:
    """A capsule 1.7 m long, standing, with a joint at a quarter and one at three quarters of its height."""
    mesh = capsule()
    vertices = np.array(mesh.vertices)[:, [1, 2, 0]]
    vertices[:, 1] -= vertices[:, 1].min()
    upper = np.clip((vertices[:, 1] - 0.4) / 0.9, 0.0, 1.0)
    weights = np.stack([1 - upper, upper], axis=1)
    joints = np.array([[0.0, 0.425, 0.0], [0.0, 1.275, 0.0]])
    return SkinnedBody(vertices, mesh.faces, ("low", "high"), joints, np.array([-1, 0]), weights)


def smpl_arrays() -> dict[str, Any]:
    truth = body()
    regressor = np.zeros((2, len(truth.vertices)))
    for k, joint in enumerate(truth.joints):  # the least weights that sum to 1 and give the joint
        rows = np.vstack([truth.vertices.T, np.ones(len(truth.vertices))])
        regressor[k] = np.linalg.lstsq(rows, np.append(joint, 1.0), rcond=None)[0]
    return {
        "v_template": truth.vertices,
        "f": truth.faces.astype(np.uint32),
        "J_regressor": regressor,
        "weights": truth.weights,
        "kintree_table": np.array([[2**32 - 1, 0], [0, 1]], dtype=np.uint32),  # as SMPL stores a root
        "shapedirs": np.tile(np.array([[0.0, 0.1, 0.0]])[:, :, None], (len(truth.vertices), 1, 3)),
        "part2num": np.array({"an": "object"}, dtype=object),  # as in SMPL-X; not looked at
    }


def write_smpl(folder: Path, **changes: Any) -> Path:
    path = folder / "model.npz"
    arrays = {name: value for name, value in (smpl_arrays() | changes).items() if value is not None}
    np.savez(path, **arrays)
    return path


def write_gltf(folder: Path, change: Callable[[dict[str, Any]], None] = lambda parts: None) -> Path:
    """The body under an armature scaled to centimetres and turned, as exporters do; its own node is moved away."""
    truth = body()
    count = len(truth.vertices)
    parts: dict[str, Any] = {
        "points": (truth.vertices * 100).astype("<f4"),
        "faces": truth.faces.astype("<u4").ravel(),
        "joints": np.tile(np.array([1, 0, 0, 0], dtype="<u2"), (count, 1)),
        "weights": np.concatenate([truth.weights[:, ::-1], np.zeros((count, 2))], axis=1).astype("<f4"),
        # the vertices are in centimetres, seen from each joint they are moved there
        "inverse": np.array([_matrix(-joint * 100) for joint in truth.joints], dtype="<f4"),
        "skinned": [2, 3],
    }
    change(parts)
    document = pygltflib.GLTF2(scene=0, scenes=[pygltflib.Scene(nodes=[0])])
    document.nodes = [
        pygltflib.Node(name="armature", scale=[0.01, 0.01, 0.01], children=[1, 2]),
        pygltflib.Node(name="body", mesh=0, skin=0, translation=[500, 0, 0]),
        pygltflib.Node(name="low", translation=(truth.joints[0] * 100).tolist(), children=[3]),
        pygltflib.Node(name="high", translation=((truth.joints[1] - truth.joints[0]) * 100).tolist()),
    ]
    document.skins = [pygltflib.Skin(joints=parts["skinned"], inverseBindMatrices=4)]
    data = b""
    kinds = {"points": ("VEC3", 5126), "faces": ("SCALAR", 5125), "joints": ("VEC4", 5123), "weights": ("VEC4", 5126)}
    for name, (kind, component) in (kinds | {"inverse": ("MAT4", 5126)}).items():
        raw = parts[name].tobytes()
        document.bufferViews.append(pygltflib.BufferView(buffer=0, byteOffset=len(data), byteLength=len(raw)))
        items = parts[name].size if kind == "SCALAR" else len(parts[name])
        document.accessors.append(
            pygltflib.Accessor(bufferView=len(document.accessors), componentType=component, count=items, type=kind)
        )
        data += raw
    attributes = pygltflib.Attributes(POSITION=0, JOINTS_0=2, WEIGHTS_0=3)
    document.meshes = [pygltflib.Mesh(primitives=[pygltflib.Primitive(attributes=attributes, indices=1)])]
    document.buffers = [pygltflib.Buffer(byteLength=len(data))]
    document.set_binary_blob(data)
    document.save(str(folder / "body.glb"))
    return folder / "body.glb"


def _matrix(move: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[3, :3] = move  # by columns
    return matrix


def write_makehuman(folder: Path) -> Path:
    """The body in decimetres as quads' halves, with a helper cube per joint, one target, a rig and weights."""
    truth = body()
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in truth.vertices * 10]
    lines += ["g body", *(f"f {a}/1 {b}/1 {c}/1" for a, b, c in truth.faces + 1)]
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.1
    first = len(truth.vertices)
    for name, joint in zip(truth.joint_names, truth.joints, strict=True):
        lines += [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in joint * 10 + corners]
        lines += [f"g joint-{name}", *(f"f {first + a} {first + b} {first + c}" for a, b, c in ((1, 2, 3), (4, 5, 6)))]
        lines += [f"f {first + 6} {first + 7} {first + 8}"]
        first += 8
    (folder / "base.obj").write_text("\n".join(lines))
    offsets = "\n".join(f"{k} 0.0 1.0 0.0" for k in range(first))
    with gzip.open(folder / "taller.target.gz", "wt") as stream:
        stream.write(f"# all a decimetre up\n{offsets}\n")
    bones = {
        "high": {"parent": "low", "head": {"strategy": "CUBE", "cube_name": "joint-high"}},
        "low": {"parent": "", "head": {"strategy": "CUBE", "cube_name": "joint-low"}},
    }
    (folder / "rig.two.json").write_text(json.dumps({"bones": bones}))
    weights = {
        name: [[k, float(w)] for k, w in enumerate(truth.weights[:, j]) if w > 0]
        for j, name in enumerate(truth.joint_names)
    }
    (folder / "weights.two.json").write_text(json.dumps({"weights": weights}))
    return folder


WRITERS: dict[str, Callable[[Path], Path]] = {"smpl": write_smpl, "gltf": write_gltf, "makehuman": write_makehuman}


@pytest.mark.parametrize("kind", WRITERS)
def test_what_was_written_comes_back(tmp_path: Path, kind: str) -> None:
    path, truth = WRITERS[kind](tmp_path), body()
    got = read_skinned(path)
    order = [got.joint_names.index(name) for name in truth.joint_names] if kind != "smpl" else [0, 1]
    near = 1e-6  # floats of 32 bits, nine digits of a decimetre
    assert_allclose(got.vertices, truth.vertices, rtol=0, atol=near)
    assert_array_equal(got.faces, truth.faces)
    assert_allclose(got.joints[order], truth.joints, rtol=0, atol=near)
    assert_allclose(got.weights[:, order], truth.weights, rtol=0, atol=near)
    assert [got.parents[k] for k in order] == [-1, order[0]]
    assert find_kind(path)[0] == "surface"
    assert_allclose(read_mesh(path).vertices, truth.vertices, rtol=0, atol=near)


def test_betas_and_targets_change_the_shape(tmp_path: Path) -> None:
    grown = read_skinned(write_smpl(tmp_path, betas=np.array([1.0, 2.0])))
    assert_allclose(grown.vertices - body().vertices, np.tile([0, 0.3, 0], (len(grown.vertices), 1)), rtol=0, atol=1e-9)
    assert_allclose(grown.joints[:, 1], body().joints[:, 1] + 0.3, rtol=0, atol=1e-9)
    folder = tmp_path / "mh"
    folder.mkdir()
    write_makehuman(folder)
    (folder / "targets.yaml").write_text("taller.target.gz: 0.5\n")
    grown = read_skinned(folder)
    assert_allclose(grown.vertices[:, 1], body().vertices[:, 1] + 0.05, rtol=0, atol=1e-6)
    assert_allclose(grown.joints[:, 1], body().joints[:, 1] + 0.05, rtol=0, atol=1e-6)


def test_a_pickle_is_never_opened(tmp_path: Path) -> None:
    trap = tmp_path / "opened"
    path = write_smpl(tmp_path, J_regressor=np.array(Payload(trap), dtype=object))
    with pytest.raises(FormatError, match="plain arrays") as caught:
        read_skinned(path)
    assert "dense arrays" in caught.value.hint
    assert not trap.exists()


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"weights": None}, "weights missing"),
        ({"v_template": np.zeros((5, 2))}, "v_template has the shape"),
        ({"weights": np.zeros((3, 2))}, "weights has the shape (3, 2)"),
        ({"kintree_table": np.array([[1, 0]])}, "parent before each joint"),
        ({"v_template": np.zeros((300_000, 3))}, "at most 200000"),
        ({"J_regressor": np.array(["a", "b"])}, "expected numbers"),
    ],
)
def test_a_wrong_body_model_is_refused(tmp_path: Path, changes: dict[str, Any], problem: str) -> None:
    with pytest.raises(FormatError) as caught:
        parse_smpl(str(write_smpl(tmp_path, **changes)))
    assert problem in caught.value.problem


def test_a_body_model_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    points = body().vertices.copy()
    points[3, 1] = np.nan
    with pytest.raises(FormatError, match="v_template holds values that are not finite"):
        parse_smpl(str(write_smpl(tmp_path, v_template=points)))
    with pytest.raises(FormatError, match="face 0 has the vertices"):
        read_skinned(write_smpl(tmp_path, f=np.array([[0, 1, 10**9]])))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda p: p.update(joints=p["joints"] + np.uint16(7)), "names joint 8; the skin has 2"),
        (lambda p: p.update(weights=p["weights"] * 0), "have no weights"),
        (lambda p: p.update(weights=p["weights"] * np.float32(np.nan)), "not finite"),
        (lambda p: p.update(joints=p["joints"][:-1]), "four per vertex"),
        (lambda p: p.update(inverse=p["inverse"][:1]), "1 matrices for 2 joints"),
        (lambda p: p.update(skinned=[2, 9]), "nodes of the scene"),
    ],
)
def test_a_wrong_skin_is_refused(tmp_path: Path, change: Callable[[dict[str, Any]], None], problem: str) -> None:
    with pytest.raises(FormatError) as caught:
        parse_gltf(str(write_gltf(tmp_path, change)))
    assert problem in caught.value.problem


@pytest.mark.parametrize(
    ("name", "text", "problem"),
    [
        ("targets.yaml", "../../etc/passwd: 1\n", "a file in this folder"),
        ("targets.yaml", "taller.target.gz: .nan\n", "outside"),
        ("targets.yaml", "smaller.target: 1\n", "no such file"),
        ("taller.target.gz", "no gzip", "not a gzipped target"),
        ("rig.two.json", '{"bones": {"a": {"parent": "b"}, "b": {"parent": "a"}}}', "form a loop"),
        ("rig.two.json", '{"bones": {"a": {"parent": "", "head": "nowhere"}}}', "not a rig"),
        ("weights.two.json", '{"weights": {"low": [[0, 1.0]]}}', "no weights"),
        ("weights.two.json", '{"weights": {"low": [[99999999, 1.0]]}}', "not a rig"),
        ("base.obj", "v 0 0 0\nv 0 17 0\nv 1 0 0\ng helper\nf 1 2 3\n", "no group 'body'"),
    ],
)
def test_a_wrong_makehuman_folder_is_refused(tmp_path: Path, name: str, text: str, problem: str) -> None:
    write_makehuman(tmp_path)
    (tmp_path / "targets.yaml").write_text("taller.target.gz: 1\n")
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        parse_makehuman(str(tmp_path))
    assert problem in caught.value.problem


def test_a_mesh_without_a_skeleton_is_told(tmp_path: Path) -> None:
    capsule().export(tmp_path / "plain.glb")
    with pytest.raises(FormatError, match="without a skeleton"):
        read_skinned(tmp_path / "plain.glb")
