"""What the fuzzer feeds: every reader of files from outside, with sound files to damage. For the child process.

The readers are called in the process itself, without the sandbox that surrounds them in earnest, so that whatever they
raise is seen.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from fuzz_captures import CAPTURES, sound_capture
from io_shapes import write_all_formats
from motion_targets import MOTIONS, write_smpl
from own_targets import OWN, sound_own
from pattern_targets import PATTERNS
from test_fabric_sheets import FAST, KES_CSV
from test_fabric_u3m import raw_data
from test_fuzz_readers import MESHES, OTHERS, read_one, write_others

from vto_pipeline.io.arrays import read_arrays, write_arrays
from vto_pipeline.io.bodies.measurements import read_measurements
from vto_pipeline.io.captures.cameras import read_trajectory
from vto_pipeline.io.documents import load_yaml, read_json
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.pipeline.batch.order import read_order

TAPE = Path(__file__).parents[2] / "sample_data" / "customer" / "measurements.yaml"
MATERIAL = {"schema": "1.1", "material": {"name": "a", "front": None, "physics": {"thickness": 0.25, "weight": 104.0}}}
TEXTS: dict[str, tuple[str, str, Callable[[Path], Any]]] = {
    "document": ("a.yaml", "schema: 1\ngiven: {left: &x [1, 2], right: *x}\nwant: [page]\n", load_yaml),
    "json": ("a.json", json.dumps({"schema": 1, "rows": [1.5, None, "a"], "more": {"b": True}}), read_json),
    "tape": (
        "a.yaml",
        TAPE.read_text(),
        read_measurements,
    ),
    "fabric": (
        "a.yaml",
        "name: poplin\nareal_density_gsm: 120\nthickness_mm: 0.3\nmembrane: {warp: 1500, weft: 1200, shear: 60}\n"
        "bending: {warp: 1.1e-5, weft: 0.9e-5, hysteresis: 1.0e-3}\nfriction: 0.3\nsource: me\n",
        read_fabric,
    ),
    "fabric_fast": ("a.yaml", FAST, read_fabric),
    "fabric_kes": ("a.csv", KES_CSV, read_fabric),
    "fabric_u3m": ("a.u3m", json.dumps(MATERIAL), read_fabric),
    "fabric_curves": ("a.json", json.dumps(raw_data()), read_fabric),
    "batch": (
        "a.yaml",
        "schema: 1\nrun: {schema: 1, given: {left: {number: l.txt}}, want: [total]}\n"
        "rows: [{name: a, seed: 1}]\nevery: {seed: [1, 2]}\n",
        read_order,
    ),
    **PATTERNS,
    **MOTIONS,
    "table": ("t.csv", "name,seed,stages.add.offset\na,1,2\nb,2,\n", lambda path: read_order(_order_beside(path))),
}
ROOMS: dict[str, list[str]] = {
    "shapes": [*MESHES, *(name for name in OTHERS if name != "a.laz")],
    "texts": [*TEXTS, "arrays", "arrays_packed", "trajectory", "motion_smpl"],
    "captures": CAPTURES,
    "runs": OWN,
}
"""Targets that one child reads, one after the other."""
SLOW = {
    **dict.fromkeys(("laz", "heic", "pattern_dxf_ours"), 20),  # 20 ms a reading, where most take 0.2 ms
    **dict.fromkeys(("stl_ascii", "pattern_dxf", "motion_yaml", "table", "frames_poses", "frames_depth"), 4),
    **dict.fromkeys(("tum_color", "makehuman_rig", "makehuman_weights", "makehuman_target", "library_target"), 4),
    **dict.fromkeys(("video_mp4", "video_avi", "obj_places", "obj_material", "obj_picture"), 4),  # 0.6 to 4 ms
}
"""How many times fewer executions a target gets than others."""


def _order_beside(table: Path) -> Path:
    path = table.with_name("order.yaml")
    path.write_text(f"schema: 1\nrun: {{schema: 1, given: {{}}, want: [total]}}\nrows: {table.name}\n")
    return path


def sound_file(target: str, folder: Path) -> tuple[Path, Callable[[Path], Any]]:
    """Return a sound file of a target, and its reader."""
    if target in TEXTS:
        name, text, read = TEXTS[target]
        (folder / name).write_text(text)
        return folder / name, read
    if target in CAPTURES:
        return sound_capture(target, folder)
    if target in OWN:
        return sound_own(target, folder)
    if target in ("arrays", "arrays_packed"):
        arrays = {"vertices": np.eye(3), "faces": np.arange(3)}
        write_arrays(folder / "a.npz", arrays, compress=target == "arrays_packed")
        return folder / "a.npz", read_arrays
    if target == "motion_smpl":
        return write_smpl(folder / "a.npz")
    if target == "trajectory":
        (folder / "a.json").write_text(json.dumps({"world_from_cam": [np.eye(4).tolist()] * 2}))
        return folder / "a.json", read_trajectory
    return (write_all_formats(folder) if target in MESHES else write_others(folder))[target], read_one
