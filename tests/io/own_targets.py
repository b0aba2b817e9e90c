"""For the fuzzer: whatever a run writes and a document may give back, and the documents that stand beside the main one.

Archives are read without their checksums here: who means harm computes them.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from fuzz_captures import directly
from PIL import Image
from test_artifacts import COLORS, FACES, KINDS, POINTS, VALUES
from test_bodies import avatar
from test_fuzz_readers import read_one
from test_gltf_draco import document, packed
from test_gltf_pictures import part, written
from test_makehuman_library import write_library
from test_obj_materials import noise, textured

from vto_pipeline.errors import FormatError
from vto_pipeline.io import meshes
from vto_pipeline.io.bodies.makehuman_library import parse_library
from vto_pipeline.io.bodies.measurements import StatureFile
from vto_pipeline.io.captures.photo_archive import read_photo_archive
from vto_pipeline.io.captures.photos import read_board
from vto_pipeline.io.documents import check_schema, load_yaml
from vto_pipeline.io.fabric_formats.strip_profiles import read_strip_profile
from vto_pipeline.io.patterns.seam_lines import read_seam_lines
from vto_pipeline.io.patterns.sewing_plan import read_sewing_plan
from vto_pipeline.io.size_charts import read_size_chart
from vto_pipeline.model.body import LifelikeBody
from vto_pipeline.model.frames import CharucoBoard, PhotoSet
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import CONTACTS, AvatarMotion, ClothMotion
from vto_pipeline.model.render import GlbPart
from vto_pipeline.stages import CATALOGUE
from vto_pipeline.stages.entry.planning import planned

Reader = Callable[[Path], Any]
TURNS = np.random.default_rng(3).normal(size=(4, 2, 3))
MORE: dict[str, Any] = {
    "avatar": avatar(),
    "lifelike_body": LifelikeBody(avatar(), np.full((6, 3), 9, np.uint8)),
    "avatar_motion": AvatarMotion(("root", "head"), TURNS, TURNS[:, 0], np.ones((4, len(CONTACTS)), bool), 0.1),
    "draped_motion": ClothMotion(np.stack([POINTS, POINTS]), FACES, 0.1),
    "motion_maps": {"stretch": POINTS[:, 0], "at_s": POINTS[:, 1]},
    "render_mesh": [GlbPart("shirt", TriangleMesh(POINTS, FACES, COLORS), uv=POINTS[:, :2] / 2)],
}
OF_RUNS = {KINDS[name].read: f"run_{name}" for name in reversed([*VALUES, *MORE, "garment_photos"])}
RUNS = sorted(set(OF_RUNS.values()) - {"run_panels"})  # of those that one function reads, one; patterns have targets

DOCUMENTS: dict[str, tuple[str, str, Reader]] = {
    "request": (
        "a.yaml",
        "schema: 1\ngiven:\n  body: {measurements: {sex: male, measurements: {stature: 180}}}\n  fabric: denim\n"
        "want: [avatar, page]\nseed: 3\nchoose: {}\nstages: {pose: {pose: a_pose}}\n",
        lambda path: planned(path, (), CATALOGUE),
    ),
    "sewing_plan": (
        "a.yaml",
        "schema: 1\npanels: {front: {at_m: [0, 1.2], mirrored: true, fold: 2}, back: {of: front, at_m: [0.1, 1]}}\n"
        "seams: [{first: [front 1, front 2], second: [back 3]}]\n",
        read_sewing_plan,
    ),
    "seam_lines": (
        "a.yaml",
        "schema: 1\nunit: cm\nseams: [{name: side, points: [[0, 1, 2], [3, 4.5, -1e-3]]}]\n",
        read_seam_lines,
    ),
    "size_chart": (
        "a.yaml",
        "schema: 1\nallowances: shirt\nmay_be_loose: [hip]\nsizes: {S: {flat_mm: {chest: 480}, made: base}}\n",
        read_size_chart,
    ),
    "strip_profile": ("a.csv", "x_mm,y_mm\n0,0\n10.5,-0.3\n20,-1.2e0\n", read_strip_profile),
    "board": ("a.yaml", "columns: 7\nrows: 5\nsquare_mm: 30\nmarker_mm: 22.5\n", read_board),
    "stature": ("a.yaml", "stature: 172\nunit: cm\n", lambda path: check_schema(load_yaml(path), StatureFile)),
}
BESIDE = {"obj_places": "*.obj", "obj_material": "*.mtl", "obj_picture": "*.png"}
SKINS = [*BESIDE, "glb_picture"]
LIBRARY = {
    "library_mesh": "3dobjs/base.obj",
    "library_target": "targets/macrodetails/african-female-young.target.gz",
}
OWN = [*RUNS, *DOCUMENTS, *SKINS, *LIBRARY, "gltf_draco"]


def read_textured(path: Path) -> Any:
    """A mesh whose picture is broken is read without it, and says so: that counts as refused, too."""
    meshes.run_limited = directly  # type: ignore[assignment]
    mesh = meshes.read_mesh(path, unit="m")
    if mesh.skin is None:
        raise FormatError("read without its picture")
    return mesh


def sound_skin(target: str, folder: Path) -> tuple[Path, Reader]:
    """Meshes with a picture, in the file or beside it."""
    if target == "glb_picture":
        return written(folder / "a.glb", part(0.0, noise(12, 16)), part(2.0, None)), read_textured
    trimesh.Scene([textured(noise(12, 16))]).export(folder / "a.obj")
    (damaged,) = folder.glob(BESIDE[target])
    return damaged, lambda _: read_textured(folder / "a.obj")


def sound_own(target: str, folder: Path) -> tuple[Path, Reader]:
    """Return the file of a target that is damaged, and what reads it."""
    zipfile.ZipExtFile._update_crc = lambda *_: None  # type: ignore[attr-defined]
    if target in SKINS:
        return sound_skin(target, folder)
    if target in DOCUMENTS:
        name, text, read = DOCUMENTS[target]
        (folder / name).write_text(text)
        return folder / name, read
    if target == "gltf_draco":
        (folder / "a.gltf").write_text(json.dumps(document(packed())))
        return folder / "a.gltf", read_one
    if target in LIBRARY:
        inside = write_library(folder)
        return inside / LIBRARY[target], lambda _: parse_library(str(inside))
    kind = KINDS[target.removeprefix("run_")]
    if kind.name == "garment_photos":
        for name in ("a.png", "b.png"):
            Image.fromarray(noise(3, 4)).save(folder / name)
        board = CharucoBoard(7, 5, 0.03, 0.02, "DICT_4X4_250")
        photos = PhotoSet((folder / "a.png", folder / "b.png"), (None, None), board)
        kind.write(folder / kind.filename, photos)
        return folder / kind.filename, read_photo_archive.__wrapped__
    kind.write(folder / kind.filename, (VALUES | MORE)[kind.name])
    return folder / kind.filename, kind.read
