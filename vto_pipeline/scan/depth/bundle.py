"""All keyframes refined together: every pair that sees the same surface, near or far apart on the path, has its say.

Neighbours on a path round an object hardly tell how far from it the camera was: a shift along the line of sight moves
both alike. Pairs that look at it from directions 20 to 50 degrees apart do.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.scan.depth.rgbd_alignment import PairSums, pair_sums, small_motion
from vto_pipeline.scan.depth.rgbd_frame import RgbdFrame

STRIDE = 2
"""Every so many pixels of the source, along both axes."""

ROUNDS = ((0.03, 5), (0.01, 10))
"""Reach [m] of matches, and Gauss-Newton steps at most."""

SETTLED = 2e-5
"""A round ends when no frame moves more [rad, m]."""

PARTNERS = 24
"""Frames that a frame is held to: so the work grows with the frames, not with their square."""

LEAST_OVERLAP = 0.2
"""Share of the source's points that must fall on the target's surface."""


@dataclass(frozen=True)
class Bundle:
    """Result of `refine_together`.

    Args:
        world_from_cam: Shape (N, 4, 4).
        pairs: How many pairs took part.
        moved: Largest shift of a camera in the last step [m].
    """

    world_from_cam: FloatArray
    pairs: int
    moved: float


def refine_together(frames: Sequence[RgbdFrame], poses: FloatArray, widest: float, job: Job) -> Bundle:
    """Refine the poses of frames by all pairs that overlap, the first pose held.

    Gauss-Newton on the residuals of `pair_sums`, matched anew in every step.

    Args:
        frames: Of one camera.
        poses: First guess of world_from_cam [m], shape (N, 4, 4).
        widest: Largest angle between lines of sight of a pair [rad].
        job: Receives progress.
    """
    pairs = choose_pairs(poses, widest)
    poses = poses.copy()
    moved, used = 0.0, 0
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for number, (reach, steps) in enumerate(ROUNDS):
            for step in range(steps):
                inverse = np.asarray(np.linalg.inv(poses), dtype=np.float64)
                motions = [inverse[target] @ poses[source] for source, target in pairs]
                sources, targets = [frames[i] for i, _ in pairs], [frames[j] for _, j in pairs]
                found = list(pool.map(pair_sums, sources, targets, motions, repeat(reach), repeat(STRIDE)))
                overlapping = [k for k, sums in enumerate(found) if sums.fitting > LEAST_OVERLAP * sums.points]
                used = len(overlapping)
                if not used:
                    break
                moves = _solve(len(frames), [pairs[k] for k in overlapping], [found[k] for k in overlapping], inverse)
                poses = np.stack([small_motion(move) @ pose for move, pose in zip(moves, poses, strict=True)])
                moved = float(np.abs(moves).max())
                done = (number + (step + 1) / steps) / len(ROUNDS)
                job.progress(0.7 + 0.3 * done, f"refining {len(frames)} keyframes together")
                if moved < SETTLED:
                    break
    return Bundle(poses, used, moved)


def choose_pairs(poses: FloatArray, widest: float) -> list[tuple[int, int]]:
    """Ordered pairs of frames whose lines of sight differ by up to an angle [rad], at most `PARTNERS` for each target.

    Of more, every so many in the order of the angle, so that all angles have their say.
    """
    forward = poses[:, :3, 2]
    cosine = forward @ forward.T
    np.fill_diagonal(cosine, -2.0)
    pairs = []
    for target, row in enumerate(cosine):
        order = np.argsort(-row, kind="stable")[: int(np.count_nonzero(row > np.cos(widest)))]
        if len(order) > PARTNERS:
            order = order[np.linspace(0, len(order) - 1, PARTNERS).round().astype(int)]
        pairs += [(int(source), target) for source in order]
    return sorted(pairs)


def _solve(count: int, pairs: list[tuple[int, int]], found: list[PairSums], inverse: FloatArray) -> FloatArray:
    """Steps (rotation, translation) of all frames in the world, shape (N, 6); the first stays.

    A pair's step in its target's frame is Ad(target from world) (step of the source - step of the target).
    """
    matrix, side = np.zeros((count, 6, count, 6)), np.zeros((count, 6))
    for (source, target), sums in zip(pairs, found, strict=True):
        adjoint = _adjoint(inverse[target])
        block, right = adjoint.T @ sums.matrix @ adjoint, adjoint.T @ sums.side
        matrix[source, :, source] += block
        matrix[target, :, target] += block
        matrix[source, :, target] -= block
        matrix[target, :, source] -= block
        side[source] += right
        side[target] -= right
    whole = matrix.reshape(6 * count, 6 * count)[6:, 6:]
    damping = 1e-9 * np.trace(whole) / len(whole)  # a frame without pairs stays
    factor = cho_factor(whole + damping * np.eye(len(whole)))
    return np.vstack([np.zeros(6), -cho_solve(factor, side.reshape(-1)[6:]).reshape(-1, 6)])


def _adjoint(transform: FloatArray) -> FloatArray:
    """How a small (rotation, translation) looks from another frame, shape (6, 6)."""
    turn, shift = transform[:3, :3], transform[:3, 3]
    cross = np.array([[0, -shift[2], shift[1]], [shift[2], 0, -shift[0]], [-shift[1], shift[0], 0]])
    return np.block([[turn, np.zeros((3, 3))], [cross @ turn, turn]])
