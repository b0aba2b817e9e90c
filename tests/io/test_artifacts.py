"""The table of artifacts: each value comes back as it was, the same value gives the same bytes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pattern_shapes import rich_pattern

from vto_pipeline.errors import InputError
from vto_pipeline.io.runs.artifacts import ARTIFACTS
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.body import Measurements, MovingBody
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.garment import Opening, RestShape, SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.model.texture import TexturedMesh

KINDS = {kind.name: kind for kind in ARTIFACTS}
RNG = np.random.default_rng(9)
POINTS = RNG.random((8, 3)) * 1.7
FACES = RNG.integers(0, 8, (9, 3)).astype(np.int32)
COLORS = RNG.integers(0, 256, (8, 3)).astype(np.uint8)
MESH = TriangleMesh(POINTS, FACES)
POSES = np.tile(np.eye(4), (2, 1, 1)) + np.pad(RNG.random((2, 3, 1)), ((0, 0), (0, 1), (3, 0)))
LENSES = (Intrinsics(80, 60, 88.1, 88.2, 39.5, 29.5, 1 / 3), Intrinsics(60, 80, 1e3 / 7, 90, 29.5, 39.5))
CAMERAS = CameraSet(("a.jpg", "é.jpg"), LENSES, POSES, metric=False, unregistered=("c.jpg",), still=True)
CLOUD = PointCloud(POINTS, -POINTS, COLORS)
DEPTH = RNG.random((2, 6, 8)).astype(np.float32)

TEXTURED = TexturedMesh(
    TriangleMesh(POINTS, FACES, COLORS, RNG.random((9, 3, 2))),
    RNG.integers(0, 256, (6, 8, 3)).astype(np.uint8),
    RNG.random((6, 8)) > 0.5,
)

VALUES: dict[str, Any] = {
    "garment_texture": TEXTURED,
    "garment_sparse": (CAMERAS, CLOUD),
    "garment_cameras": CAMERAS,
    "garment_points": CLOUD,
    "garment_depth_maps": DepthMaps(CAMERAS.names, LENSES, POSES, DEPTH),
    "garment_trajectory": POSES,
    "garment_surface": TriangleMesh(POINTS, FACES, COLORS),
    "garment_scan_report": {"metric": True, "scale": {"source": "board", "error_percent": 0.01}},
    "garment_placement": POSES[0],
    "source_turn": POSES[1],
    "labels": SurfaceLabels(RNG.random(8) > 0.5, RNG.random(8)),
    "garment_shell": MESH,
    "garment": MESH,
    "openings": (
        Opening(np.array([3, 1, 2], np.int32), 0.1 + 0.2, POINTS[0], POINTS[1]),
        Opening(np.array([5, 6, 7, 4], np.int32), 1 / 3, POINTS[2], POINTS[3]),
    ),
    "sim_mesh": MESH,
    "rest_shape": RestShape(POINTS, True, "gravity_removed", panels=np.random.default_rng(5).normal(size=(7, 3, 2))),
    "measurements": Measurements({"stature": 1.7, "hip_girth": 2 / 3}, {}, "female"),
    "landmarks": {"crown": POINTS[0], "crotch": POINTS[1]},
    "collider": MovingBody(np.stack([POINTS, POINTS + 0.1]), FACES),
    "draped": MESH,
    "audit": {"finite": True, "intersections": 0, "strain": [0.1, 1 / 3]},
    "trace": (TraceRow(0.1, 1, 12.5, 1 / 3, 2, 17, 0.1, 1 / 7, 3.0), TraceRow(2.5e-7, 20, 1e-9, 0.0)),
    "fit_report": {"zones": {"waist": {"ease_mm": -3.25}}},
    "observed": RNG.random(8) > 0.5,
    "fit_maps": {"stretch": RNG.random(8), "clearance_mm": RNG.random(8)},
    "panels": rich_pattern(),
    "garment_mesh": TriangleMesh(POINTS, FACES, texture=np.random.default_rng(6).random((9, 3, 2))),
    "page": "<!doctype html><p>é</p>\n",
}


def same(a: Any, b: Any) -> bool:
    """Equal to the bit, arrays included."""
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, Mapping):
        return set(a) == set(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)


@pytest.mark.parametrize("name", VALUES)
def test_a_value_comes_back_to_the_bit_and_has_one_form(tmp_path: Path, name: str) -> None:
    kind = KINDS[name]
    first, second = tmp_path / "1" / kind.filename, tmp_path / "2" / kind.filename
    kind.write(first, VALUES[name])
    kind.write(second, kind.read(first))
    assert same(VALUES[name], kind.read(first))
    assert first.read_bytes() == second.read_bytes()
    assert [path.name for path in first.parent.iterdir()] == [kind.filename]


def test_a_render_mesh_is_stable_after_its_first_rounding(tmp_path: Path) -> None:
    """GLB holds single precision: what was read once is written and read without further change."""
    kind = KINDS["render_mesh"]
    part = GlbPart("shirt", TriangleMesh(POINTS, FACES, COLORS), uv=POINTS[:, :2] / 2)
    kind.write(tmp_path / "a.glb", [part])
    once = kind.read(tmp_path / "a.glb")
    kind.write(tmp_path / "b.glb", once)
    assert same(once, kind.read(tmp_path / "b.glb"))
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_every_kind_has_a_case_or_is_only_given_or_stands_for_a_role() -> None:
    tried = set(VALUES) | {"render_mesh", "avatar", "fitted_avatar", "source_avatar"}  # the avatars in test_bodies.py
    tried |= {"garment_photos"}  # tests/scan/test_keyframes.py
    rest = {k.name for k in ARTIFACTS if k.filename} - tried
    assert all(name.removeprefix("body_").removeprefix("mannequin_") in _garment_suffixes() for name in rest)


def _garment_suffixes() -> set[str]:
    return {name.removeprefix("garment_") for name in KINDS}


def test_names_and_files_are_unique_and_those_of_the_contract() -> None:
    names = [kind.name for kind in ARTIFACTS]
    files = [kind.filename for kind in ARTIFACTS if kind.filename] + [f for kind in ARTIFACTS for f, _ in kind.previews]
    assert len(set(names)) == len(names)
    assert len(set(files)) == len(files)
    contract = (
        "cameras.json points.ply surface.ply garment.ply labels.npz sim_mesh.ply rest_shape.npz avatar.npz avatar.ply "
        "measurements.json landmarks.json draped.ply audit.json trace.csv render_mesh.glb fit_report.json page.html"
    )
    assert set(contract.split()) <= set(files)


@pytest.mark.parametrize(
    "name", [k.name for k in ARTIFACTS if k.filename and k.name not in ("avatar", "source_avatar")]
)
def test_a_missing_or_empty_file_is_an_input_error(tmp_path: Path, name: str) -> None:
    kind = KINDS[name]
    with pytest.raises(InputError, match="no such file"):
        kind.read(tmp_path / kind.filename)
    (tmp_path / kind.filename).write_bytes(b"")
    with pytest.raises(InputError, match="empty"):
        kind.read(tmp_path / kind.filename)


def test_a_given_mesh_is_received_with_its_guess_told_and_ours_is_taken_as_it_is(tmp_path: Path) -> None:
    kind: ArtifactKind = KINDS["mannequin_surface"]
    kind.write(tmp_path / "form.ply", TriangleMesh(POINTS * 100, FACES))
    assert np.array_equal(kind.read(tmp_path / "form.ply").vertices, POINTS * 100)
    assert kind.receive is not None
    job = Job()
    assert np.ptp(kind.receive(tmp_path / "form.ply", job).vertices) < 2.0
    assert any("unit: assumed to be cm" in note for note in job.notes)
    assert kind.inline is not None
    given = kind.inline({"file": tmp_path / "form.ply", "unit": "mm"})
    assert np.ptp(given.vertices) < 0.2
    with pytest.raises(InputError, match="expected a path, or a mapping such as {file: shirt.obj, unit: cm}"):
        kind.inline({"path": "x"})
