"""Parts of an avatar that are kept off others.

An avatar that does what a slimmer person did passes its limbs through its trunk. Each part is swung at its joint, the
shortest way, until all of it has its room, and so gently over time that the swing itself is no jerk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from vto_pipeline.avatar.model.skinning import blend_transforms
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.kinematics import local_rotations, matrix_vectors, vector_matrices

_MORE_M = 2e-3
"""What is aimed at beyond the room, so that few rounds do."""
_SPACING_M = 0.05
"""Of the places that are looked at, and the reach of each as a part of the surface."""
_REACH_M = 0.09  # a place that is farther from all of them is beside the body: their planes say nothing there
_FAR_M = 0.2  # what is farther from all of a part on any axis is left out
_ROUNDS = 12
_TURN_RAD = 0.15  # of a round, at most
_DEEPEST = 4  # power of what places lack by which they count: larger ones let the deepest lead alone
_DAMPING_M = 0.05  # a place that a turn lifts by less than that for each radian hardly counts
_FRAMES = 16  # at a time: distances of all pairs of places fit into the cache
_EASE_S = 0.15
"""Time on either side over which a part goes out of the way, and comes back."""
_EASED = (1.0, 1.0, 1.0, 0.5, 0.25)
"""Shares of that time: an eased swing may lead another way, so what is still missing is swung again, at last faster."""


@dataclass(frozen=True)
class Part:
    """What is swung.

    Args:
        pivot: The joint that it is swung about.
        moved: Joints that turn with it.
        places: Vertices that are looked at.
        others: Vertices that stand for the surface that it is kept off.
        room: Between both [m].
    """

    pivot: int
    moved: tuple[int, ...]
    places: NDArray[np.int64]
    others: NDArray[np.int64]
    room: float


class Apart:
    """Parts of an avatar, and what they are kept off.

    Args:
        avatar: Any of our bodies.
        parts: Of it, each of which is kept off its others.
    """

    def __init__(self, avatar: Avatar, parts: Sequence[Part]) -> None:
        self._avatar, self.parts = avatar, parts
        self._normals = vertex_normals(TriangleMesh(avatar.bind_vertices, avatar.faces))

    def kept(
        self, poses: FloatArray, root: FloatArray, free: FloatArray, frame_time: float
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return poses whose parts have room, shape (T, J, 3), and in which frames one had none, shape (T,).

        Args:
            poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
            root: Places of the root [m], shape (T, 3).
            free: How much of its swing each part may make, 0 to 1, shape (T, K).
            frame_time: [s].
        """
        close, looked_at = np.zeros(len(poses), dtype=bool), free.any(axis=1)
        for share in _EASED:
            turn, place = posed_joints(self._avatar, poses, root)
            swings = np.zeros((*free.shape, 3))
            swings[looked_at] = self.swings(turn[looked_at], place[looked_at])
            swings[free == 0.0] = 0.0
            if not swings.any():
                break
            close |= swings.any(axis=(1, 2))
            swings = free[..., None] * eased(swings, share * _EASE_S, frame_time)
            looked_at = swings.any(axis=(1, 2))
            poses = matrix_vectors(local_rotations(self._avatar.parents.tolist(), self.swung(turn, swings)))
        return poses, close

    def swings(self, turn: FloatArray, place: FloatArray) -> FloatArray:
        """Return how the parts have to be turned about their pivots in the world, shape (T, K, 3).

        Args:
            turn: World rotations of the joints relative to the bind pose, shape (T, J, 3, 3).
            place: World places of the joints [m], shape (T, J, 3).
        """
        found = np.zeros((len(turn), len(self.parts), 3))
        for first in range(0, len(turn), _FRAMES):
            some = slice(first, first + _FRAMES)
            moves = self._moves(turn[some], place[some])
            surfaces: dict[int, tuple[FloatArray, FloatArray]] = {}  # both arms are kept off one
            for k, part in enumerate(self.parts):
                places, _ = self._skin(part.places, *moves)
                if id(part.others) not in surfaces:
                    surfaces[id(part.others)] = self._skin(part.others, *moves)
                surface = surfaces[id(part.others)]
                found[some, k] = _swing(places, place[some][:, part.pivot], *surface, part.room)
        return found

    def swung(self, turn: FloatArray, swings: FloatArray) -> FloatArray:
        """Return rotations of a motion whose parts are turned so, shape (T, J, 3, 3)."""
        turned = turn.copy()
        for k, part in enumerate(self.parts):
            turned[:, part.moved] = vector_matrices(swings[:, k])[:, None] @ turn[:, part.moved]
        return turned

    def _moves(self, turn: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what joints do to the bind pose, x -> R x + t, shapes (T, J, 3, 3) and (T, J, 3)."""
        return turn, place - np.einsum("tjab,jb->tja", turn, self._avatar.joints)

    def _skin(self, vertices: NDArray[np.int64], turn: FloatArray, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where vertices are, as the avatar's skin is but at its shoulders, and normals, (T, N, 3) each."""
        turn, offset = blend_transforms(self._avatar.weights[vertices], turn, offset)
        places = np.einsum("tnab,nb->tna", turn, self._avatar.bind_vertices[vertices]) + offset
        return places, np.einsum("tnab,nb->tna", turn, self._normals[vertices])


def eased(swings: FloatArray, seconds: float, frame_time: float) -> FloatArray:
    """Return swings without a jump: each is the mean of the largest about the frames near it, shape (T, S, 3).

    Args:
        swings: Of all frames, shape (T, S, 3).
        seconds: On either side, over which they come and go [s].
        frame_time: [s].
    """
    reach = max(1, round(seconds / frame_time))
    size = np.pad(np.linalg.norm(swings, axis=-1), ((reach, reach), (0, 0)), mode="edge")
    largest = sliding_window_view(size, 2 * reach + 1, axis=0).argmax(axis=-1) - reach
    chosen = np.clip(np.arange(len(swings))[:, None] + largest, 0, len(swings) - 1)
    window = np.hanning(2 * reach + 3)[1:-1]
    largest_swings = np.take_along_axis(swings, chosen[..., None], axis=0)
    return np.asarray(convolve1d(largest_swings, window / window.sum(), axis=0, mode="nearest"))


def _swing(part: FloatArray, pivot: FloatArray, others: FloatArray, normals: FloatArray, room: float) -> FloatArray:
    """Return how a part is turned about its pivot in the world, shape (T, 3).

    Args:
        part: Its places [m], shape (T, N, 3).
        pivot: [m], shape (T, 3).
        others: Places of what it is kept off [m], shape (T, M, 3).
        normals: There, outward, shape (T, M, 3).
        room: [m].
    """
    swing, at = np.tile(np.eye(3), (len(part), 1, 1)), np.arange(len(part))
    lever = part - pivot[:, None]
    for _ in range(_ROUNDS):
        height, away = _heights(pivot[at, None] + lever[at], others[at], normals[at])
        short = np.maximum(room - height, 0.0)
        close = short.any(axis=1)
        if not close.any():
            break
        at, short = at[close], short[close]
        further = vector_matrices(_turn(lever[at], away[close], np.where(short > 0.0, short + _MORE_M, 0.0)))
        lever[at] = np.einsum("tij,tnj->tni", further, lever[at])
        swing[at] = further @ swing[at]
    return matrix_vectors(swing)


def _turn(lever: FloatArray, away: FloatArray, short: FloatArray) -> FloatArray:
    """Return the turn that lifts places by what they are short of, by damped least squares [rad], shape (T, 3).

    Those that are short of most count most. The deepest alone may be lifted here in one frame and there in the next;
    all alike are led by places that are almost out.

    Args:
        lever: From the pivot to the places [m], shape (T, N, 3).
        away: Along which they are lifted, shape (T, N, 3).
        short: By how much [m], shape (T, N); 0 where a place has its room, but not of all places of a frame.
    """
    lift = np.where(short[..., None] > 0.0, np.cross(lever, away), 0.0)
    weighted = lift * ((short / short.max(axis=1, keepdims=True)) ** _DEEPEST)[..., None]
    square = np.swapaxes(weighted, -1, -2) @ lift + _DAMPING_M**2 * np.eye(3)
    turn = np.linalg.solve(square, np.einsum("tni,tn->ti", weighted, short)[..., None])[..., 0]
    size = np.linalg.norm(turn, axis=1, keepdims=True)
    limited: FloatArray = turn * np.minimum(1.0, _TURN_RAD / np.maximum(size, 1e-12))
    return limited


def _heights(points: FloatArray, body: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how high points are above a surface [m], inf far from it, (T, N), and the normals there, (T, N, 3).

    The surface is known by places and normals; heights above their planes are averaged, near ones counting most, so
    that they change without a jump (Kolluri 2008, "Provably good moving least squares").
    """
    low, high = points.min(axis=(0, 1)) - _FAR_M, points.max(axis=(0, 1)) + _FAR_M
    about = ((body > low) & (body < high)).all(axis=2).any(axis=0)
    if not about.any():
        return np.full(points.shape[:2], np.inf), np.zeros_like(points)
    body, normals = body[:, about], normals[:, about]
    square = points @ np.swapaxes(-2.0 * body, -1, -2)
    square += np.einsum("tni,tni->tn", points, points)[:, :, None]
    square += np.einsum("tmi,tmi->tm", body, body)[:, None]
    nearest = square.min(axis=2, keepdims=True)
    share = np.exp((nearest - square) / _SPACING_M**2)
    share /= share.sum(axis=2, keepdims=True)
    normal = share @ normals
    planes = np.einsum("tmi,tmi->tm", body, normals)
    height = np.einsum("tni,tni->tn", points, normal) - (share @ planes[:, :, None])[:, :, 0]
    return np.where(nearest[:, :, 0] < _REACH_M**2, height, np.inf), normal


def spread(vertices: NDArray[np.int64], places: FloatArray, spacing: float = _SPACING_M) -> NDArray[np.int64]:
    """Return one of these vertices for each cube of the spacing that holds any."""
    cubes = np.floor(places[vertices] / spacing).astype(np.int64)
    return vertices[np.unique(cubes, axis=0, return_index=True)[1]]
