"""A person who moves, with world places by homogeneous matrices, and BVH files of them in any dialect."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

BONES = {
    "Hips": (None, (0.0, 0.95, 0.0)),
    "Spine": ("Hips", (0.0, 0.12, -0.01)),
    "Spine1": ("Spine", (0.0, 0.16, 0.0)),
    "Neck": ("Spine1", (0.0, 0.25, 0.0)),
    "Head": ("Neck", (0.0, 0.1, 0.02)),
    "LeftShoulder": ("Spine1", (0.03, 0.2, 0.0)),
    "LeftArm": ("LeftShoulder", (0.15, 0.0, 0.0)),
    "LeftForeArm": ("LeftArm", (0.29, 0.0, 0.0)),
    "LeftHand": ("LeftForeArm", (0.26, 0.0, 0.0)),
    "RightShoulder": ("Spine1", (-0.03, 0.2, 0.0)),
    "RightArm": ("RightShoulder", (-0.15, 0.0, 0.0)),
    "RightForeArm": ("RightArm", (-0.29, 0.0, 0.0)),
    "RightHand": ("RightForeArm", (-0.26, 0.0, 0.0)),
    "LeftUpLeg": ("Hips", (0.09, -0.05, 0.0)),
    "LeftLeg": ("LeftUpLeg", (0.0, -0.41, 0.0)),
    "LeftFoot": ("LeftLeg", (0.0, -0.4, -0.02)),
    "LeftToeBase": ("LeftFoot", (0.0, -0.07, 0.13)),
    "RightUpLeg": ("Hips", (-0.09, -0.05, 0.0)),
    "RightLeg": ("RightUpLeg", (0.0, -0.41, 0.0)),
    "RightFoot": ("RightLeg", (0.0, -0.4, -0.02)),
    "RightToeBase": ("RightFoot", (0.0, -0.07, 0.13)),
}
NAMES = list(BONES)
PARENTS = [NAMES.index(parent) if parent else -1 for parent, _ in BONES.values()]
OFFSETS = np.array([offset for _, offset in BONES.values()])
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From +Y up to +Z up."""


@dataclass(frozen=True)
class Moves:
    """Local rotations (T, J, 3, 3), and the root's places (T, 3) [m]."""

    turns: np.ndarray
    root: np.ndarray

    def places(self) -> np.ndarray:
        """World places by products of 4x4 matrices, shape (T, J, 3)."""
        found = np.empty((*self.turns.shape[:2], 3))
        for t in range(len(self.turns)):
            world = []
            for j, parent in enumerate(PARENTS):
                local = np.eye(4)
                local[:3, :3] = self.turns[t, j]
                local[:3, 3] = self.root[t] if parent < 0 else OFFSETS[j]
                world.append(local if parent < 0 else world[parent] @ local)
            found[t] = [matrix[:3, 3] for matrix in world]
        return found


def random_moves(frames: int = 5, seed: int = 3, spread_deg: float = 35.0) -> Moves:
    """Every joint turned at random in every frame, the body as a whole upright."""
    rng = np.random.default_rng(seed)
    vectors = np.deg2rad(rng.uniform(-spread_deg, spread_deg, (frames, len(NAMES), 3))) / np.sqrt(3)
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(frames, -1, 3, 3)
    return Moves(turns, OFFSETS[0] + rng.uniform(-0.2, 0.2, (frames, 3)))


def bvh_text(
    moves: Moves,
    *,
    order: str = "ZXY",
    metres: float = 0.01,
    z_up: bool = False,
    places: str = "root",
    names: Sequence[str] = NAMES,
    newline: str = "\n",
    indent: str = "\t",
    frame_time: float = 1 / 30,
    frames_line: int | None = None,
) -> str:
    """Write moves as BVH.

    Args:
        moves: What to write.
        order: Of the rotation channels.
        metres: Per unit of the file.
        z_up: Whether +Z points up in the file.
        places: Joints with position channels: "root", "all" from the parent, or "all_zero" from the offset.
        names: Of the joints.
        newline: End of a line.
        indent: A step of indentation.
        frame_time: [s].
        frames_line: Count that the header promises; None: the right one.
    """
    axes = Z_UP if z_up else np.eye(3)
    offsets = OFFSETS @ axes.T / metres
    lines = ["HIERARCHY"]
    written: list[int] = []

    def joint(j: int, depth: int) -> None:
        written.append(j)
        pad = indent * depth
        lines.append(f"{pad}{'ROOT' if PARENTS[j] < 0 else 'JOINT'} {names[j]}")
        lines.append(pad + "{")
        lines.append(f"{pad}{indent}OFFSET " + " ".join(f"{x:.9f}" for x in offsets[j]))
        turns = " ".join(f"{axis}rotation" for axis in order)
        placed = places != "root" or PARENTS[j] < 0
        head = "6 Xposition Yposition Zposition " if placed else "3 "
        lines.append(f"{pad}{indent}CHANNELS {head}{turns}")
        children = [k for k, parent in enumerate(PARENTS) if parent == j]
        for child in children:
            joint(child, depth + 1)
        if not children:
            tip = indent * (depth + 1)
            lines.extend([f"{tip}End Site", tip + "{", f"{tip}{indent}OFFSET 0 0 {0.05 / metres:.6f}", tip + "}"])
        lines.append(pad + "}")

    joint(0, 0)
    count = len(moves.turns) if frames_line is None else frames_line
    lines += ["MOTION", f"Frames: {count}", f"Frame Time: {frame_time:.7f}"]
    turns = axes @ moves.turns @ axes.T
    for t in range(len(turns)):
        row: list[float] = []
        for j in written:
            if PARENTS[j] < 0:
                row += list(axes @ moves.root[t] / metres)
            elif places == "all":
                row += list(offsets[j])
            elif places == "all_zero":
                row += [0.0, 0.0, 0.0]
            row += list(Rotation.from_matrix(turns[t, j]).as_euler(order, degrees=True))
        lines.append(" ".join(f"{x:.8f}" for x in row))
    return newline.join(lines) + newline


def write_bvh(path: Path, moves: Moves, **options) -> Path:
    """Write a BVH file; see `bvh_text`."""
    path.write_bytes(bvh_text(moves, **options).encode())
    return path


TRACKED = {
    "shoulder": "Arm",
    "elbow": "ForeArm",
    "wrist": "Hand",
    "hip": "UpLeg",
    "knee": "Leg",
    "ankle": "Foot",
    "toe": "ToeBase",
}
"""What a camera follows: our joint -> the bone that begins there."""


def tracked_places(moves: Moves) -> dict[str, np.ndarray]:
    """World places of the joints that a camera follows [m], shape (T, 3) each."""
    places = moves.places()
    return {
        f"{side.lower()}_{ours}": places[:, NAMES.index(f"{side}{bone}")]
        for ours, bone in TRACKED.items()
        for side in ("Left", "Right")
    }


def tracked_text(moves: Moves, step_s: float | None = 0.04, size: float = 1.0) -> str:
    """The same as JSON lines, of a person so many times as large."""
    found = tracked_places(moves)
    lines = []
    for t in range(len(moves.turns)):
        time = {} if step_s is None else {"time_s": step_s * t}
        lines.append(json.dumps(time | {"joints": {name: (size * place[t]).tolist() for name, place in found.items()}}))
    return "\n".join(lines) + "\n"
