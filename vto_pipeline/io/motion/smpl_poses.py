"""Pose sequences of the SMPL family, in the layout of AMASS."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays, read_arrays
from vto_pipeline.io.motion.bvh import MOST_TURNS
from vto_pipeline.io.motion.gaps import fill_gaps
from vto_pipeline.io.motion.standard_skeleton import NAMES, standard_skeleton
from vto_pipeline.numerics.kinematics import matrix_quaternions, vector_matrices

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
_ROOTS = ("poses", "root_orient", "global_orient")
_BODIES = ("pose_body", "body_pose")
_PLACES = ("trans", "transl")
_HINT = "expected poses (T, 3 J), or root_orient (T, 3) and pose_body (T, 63), and trans (T, 3)"
_DEFAULT_RATE = 30.0
_LARGEST = 1e4


def parse_smpl_poses(name: str) -> Arrays:
    """Read a sequence of poses: rotation vectors of SMPL, SMPL-H or SMPL-X (Loper et al. 2015). Runs in the sandbox.

    The body's 22 joints are taken; hands and face are left. The file holds no skeleton: an ordinary one stands in.

    Args:
        name: Path of an .npz file.

    Returns:
        As `parse_bvh`.

    Raises:
        FormatError: arrays are missing, of the wrong shape, or hold no numbers.
    """
    arrays = read_arrays(Path(name), only=(*_RATES, *_ROOTS, *_BODIES, *_PLACES))
    for key, array in arrays.items():
        if array.dtype.kind not in "fiu":
            raise FormatError(f"{key} holds {array.dtype}; expected numbers", where=name, hint=_HINT)
    poses = next((arrays[key] for key in _ROOTS if key in arrays), None)
    if poses is None or poses.ndim == 0 or len(poses) == 0:
        raise FormatError("no poses", where=name, hint=_HINT)
    if poses.size > 4 * MOST_TURNS * 3:
        raise FormatError(f"poses of {poses.size} numbers; at most {12 * MOST_TURNS} are read", where=name)
    frames = len(poses)
    vectors = poses.reshape(frames, -1).astype(np.float64)
    body = next((arrays[key] for key in _BODIES if key in arrays), None)
    if vectors.shape[1] == 3 and body is not None:
        if len(np.atleast_1d(body)) != frames or body.size < frames * 3:
            raise FormatError(f"body poses of shape {body.shape} for {frames} frames", where=name, hint=_HINT)
        vectors = np.concatenate([vectors, body.reshape(frames, -1).astype(np.float64)], axis=1)
    joints = len(NAMES)
    if vectors.shape[1] < 3 * joints or vectors.shape[1] % 3:
        problem = f"{vectors.shape[1]} numbers a frame; expected 3 a joint, from {joints} joints on"
        raise FormatError(problem, where=name, hint=_HINT)
    turns = vectors[:, : 3 * joints].reshape(frames, joints, 3)
    places = next((arrays[key] for key in _PLACES if key in arrays), np.zeros((frames, 3)))
    if places.shape != (frames, 3):
        raise FormatError(f"trans has the shape {places.shape}; expected ({frames}, 3)", where=name, hint=_HINT)
    places = places.astype(np.float64)
    notes = ["the file holds no skeleton: one of ordinary proportions stands in"]
    rate = next((float(arrays[key].ravel()[0]) for key in _RATES if key in arrays and arrays[key].size), None)
    if rate is None:
        rate = _DEFAULT_RATE
        notes.append(f"the file holds no frame rate: {rate:g} frames a second are assumed")
    if not 0.1 <= rate <= 1e4:
        raise FormatError(f"{rate:g} frames a second", where=name)
    both = np.concatenate([turns.reshape(frames, -1), places], axis=1)
    lost = np.logical_not(np.all(abs(both) < _LARGEST, axis=1))  # NaN is below nothing
    turns, places = np.where(lost[:, None, None], 0.0, turns), np.where(lost[:, None], 0.0, places)
    parents, offsets = standard_skeleton()
    rotations = matrix_quaternions(vector_matrices(turns))
    translations = np.tile(offsets, (frames, 1, 1))
    translations[:, 0] += places
    rotations, translations, warnings = fill_gaps(rotations, translations, lost, 1.0 / rate, Path(name))
    return {
        "joint_names": np.array(NAMES, dtype=np.str_),
        "parents": np.array(parents, dtype=np.int64),
        "offsets": offsets,
        "rest": np.tile([0.0, 0.0, 0.0, 1.0], (joints, 1)),
        "rotations": rotations,
        "translations": translations,
        "frame_time": np.array(1.0 / rate),
        "dialect": np.array("poses of the SMPL family"),
        "notes": np.array(notes, dtype=np.str_),
        "warnings": np.array(warnings, dtype=np.str_),
    }
