"""Sound motions for the fuzzer, and their readers without the sandbox."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from motion_shapes import bvh_text, random_moves, tracked_text
from test_motion_formats import person_gltf

from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.motion.bvh import parse_bvh
from vto_pipeline.io.motion.gltf_animation import parse_animation
from vto_pipeline.io.motion.keyframes import parse_keyframes
from vto_pipeline.io.motion.read import presets, understood
from vto_pipeline.io.motion.smpl_poses import parse_smpl_poses
from vto_pipeline.io.motion.tracked.parse import parse_tracked
from vto_pipeline.model.job import Job


def _read(parse: Callable[[str], Arrays]) -> Callable[[Path], Any]:
    return lambda path: understood(parse(str(path)), path, None, None, Job())


def _gltf() -> str:
    with tempfile.TemporaryDirectory() as folder:
        return person_gltf(Path(folder) / "a.gltf", random_moves(3), 0.01).read_text()


def write_smpl(path: Path) -> tuple[Path, Callable[[Path], Any]]:
    """Write poses of the SMPL family; return the file and its reader."""
    rng = np.random.default_rng(1)
    np.savez(path, poses=rng.uniform(-0.3, 0.3, (3, 72)), trans=np.zeros((3, 3)), mocap_framerate=np.array(30.0))
    return path, _read(parse_smpl_poses)


MOTIONS: dict[str, tuple[str, str, Callable[[Path], Any]]] = {
    "motion_jsonl": ("a.jsonl", tracked_text(random_moves(3)), _read(parse_tracked)),
    "motion_bvh": ("a.bvh", bvh_text(random_moves(3), places="all"), _read(parse_bvh)),
    "motion_gltf": ("a.gltf", _gltf(), _read(parse_animation)),
    "motion_yaml": ("a.yaml", presets()["walking_step"].read_text(), _read(parse_keyframes)),
}
