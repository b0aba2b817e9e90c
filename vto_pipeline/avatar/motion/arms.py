"""Arms that are kept off the trunk and the thighs.

An avatar that does what a slimmer person did passes its arms through its trunk. Each arm is swung at its shoulder, the
shortest way, until all of it has the room that a sleeve and what it hangs beside need.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.kinematics import matrix_vectors, vector_matrices

_SIDES = ("left", "right")
_ARM = ("shoulder", "elbow", "wrist")
_BODY = ("pelvis", "spine", "chest", "left_hip", "right_hip")
_ROOM_M = 0.015
_MORE_M = 2e-3
"""What is aimed at beyond the room, so that few rounds do."""
_SPACING_M = 0.05
"""Of the places that are looked at, and the reach of each as a part of the surface."""
_REACH_M = 0.09  # a place that is farther from all of them is beside the body: their planes say nothing there
_ARMPIT_M = 0.07  # from the shoulder: so far, skin and cloth are pressed between arm and trunk in everyone
_RIGID = 0.95  # share of the weights of one bone from which on a place of the arm goes with that bone
_BLENDS = 0.2  # share of an arm's weights from which on a place of the trunk is armpit or shoulder
_ROUNDS = 12
_TURN_RAD = 0.15  # of a round, at most
_FRAMES = 16  # at a time: distances of all pairs of places fit into the cache
_EASE_S = 0.15
"""Time on either side over which an arm goes out of the way, and comes back."""


class Arms:
    """The arms of an avatar, and what they are kept off.

    Args:
        avatar: Any of our bodies.
    """

    def __init__(self, avatar: Avatar) -> None:
        self._avatar = avatar
        names, bind = list(avatar.joint_names), avatar.bind_vertices
        self._chains = [[names.index(f"{side}_{part}") for part in _ARM] for side in _SIDES]
        shoulders = [names.index(f"{side}_{part}") for side in _SIDES for part in ("clavicle", *_ARM)]
        self._owner = avatar.weights.argmax(axis=1)
        trunk = np.isin(self._owner, [names.index(name) for name in _BODY])
        trunk &= avatar.weights[:, shoulders].sum(axis=1) < _BLENDS
        self._body = _spread(np.flatnonzero(trunk), bind)
        self._normals = vertex_normals(TriangleMesh(bind, avatar.faces))[self._body]
        self._places = []
        for chain in self._chains:
            own = np.isin(self._owner, chain) & (avatar.weights.max(axis=1) >= _RIGID)
            own &= np.linalg.norm(bind - avatar.joints[chain[0]], axis=1) > _ARMPIT_M
            self._places.append(_spread(np.flatnonzero(own), bind))

    def swings(self, turn: FloatArray, place: FloatArray) -> FloatArray:
        """Return how the arms, left and right, have to be turned about their shoulders in the world, shape (T, 2, 3).

        Args:
            turn: World rotations of the joints relative to the bind pose, shape (T, J, 3, 3).
            place: World places of the joints [m], shape (T, J, 3).
        """
        found = np.zeros((len(turn), len(self._chains), 3))
        for first in range(0, len(turn), _FRAMES):
            part = slice(first, first + _FRAMES)
            body, normals = self._body_places(turn[part], place[part])
            for k, (chain, places) in enumerate(zip(self._chains, self._places, strict=True)):
                joint = self._owner[places]
                away = self._avatar.bind_vertices[places] - self._avatar.joints[joint]
                arm = np.einsum("tnij,nj->tni", turn[part][:, joint], away) + place[part][:, joint]
                found[part, k] = _swing(arm, place[part][:, chain[0]], body, normals)
        return found

    def swung(self, turn: FloatArray, swings: FloatArray) -> FloatArray:
        """Return rotations of a motion whose arms are turned so, shape (T, J, 3, 3)."""
        turned = turn.copy()
        for k, chain in enumerate(self._chains):
            turned[:, chain] = vector_matrices(swings[:, k])[:, None] @ turn[:, chain]
        return turned

    def _body_places(self, turn: FloatArray, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return places of the body by the linear blend, as trunks bend little, and normals there, (T, N, 3) each."""
        weights = self._avatar.weights[self._body]
        mixed = np.tensordot(weights, turn, (1, 1)).transpose(1, 0, 2, 3)
        offset = place - np.einsum("tjab,jb->tja", turn, self._avatar.joints)
        places = np.einsum("tnab,nb->tna", mixed, self._avatar.bind_vertices[self._body]) + weights @ offset
        normals = np.einsum("tnij,nj->tni", turn[:, self._owner[self._body]], self._normals)
        return places, normals


def eased(swings: FloatArray, frame_time: float) -> FloatArray:
    """Return swings without a jump: each is the mean of the largest about the frames near it, shape (T, S, 3).

    Args:
        swings: Of all frames, shape (T, S, 3).
        frame_time: [s].
    """
    reach = max(1, round(_EASE_S / frame_time))
    size = np.pad(np.linalg.norm(swings, axis=-1), ((reach, reach), (0, 0)), mode="edge")
    largest = sliding_window_view(size, 2 * reach + 1, axis=0).argmax(axis=-1) - reach
    chosen = np.clip(np.arange(len(swings))[:, None] + largest, 0, len(swings) - 1)
    window = np.hanning(2 * reach + 3)[1:-1]
    largest_swings = np.take_along_axis(swings, chosen[..., None], axis=0)
    return np.asarray(convolve1d(largest_swings, window / window.sum(), axis=0, mode="nearest"))


def _swing(arm: FloatArray, shoulder: FloatArray, body: FloatArray, normals: FloatArray) -> FloatArray:
    """Return how an arm is turned about its shoulder in the world, shape (T, 3).

    Args:
        arm: Its places [m], shape (T, N, 3).
        shoulder: [m], shape (T, 3).
        body: Places of what it is kept off [m], shape (T, M, 3).
        normals: There, outward, shape (T, M, 3).
    """
    swing, at = np.tile(np.eye(3), (len(arm), 1, 1)), np.arange(len(arm))
    lever = arm - shoulder[:, None]
    for _ in range(_ROUNDS):
        height, away = _heights(shoulder[at, None] + lever[at], body[at], normals[at])
        deepest = height.argmin(axis=1)
        rows = np.arange(len(at))
        short = _ROOM_M - height[rows, deepest]
        close = short > 0.0
        if not close.any():
            break
        at, rows, deepest, short = at[close], rows[close], deepest[close], short[close]
        axis = np.cross(lever[at, deepest], away[rows, deepest])
        length = np.maximum(np.linalg.norm(axis, axis=1), 1e-6)
        angle = np.minimum((short + _MORE_M) / length, _TURN_RAD)
        further = vector_matrices((angle / length)[:, None] * axis)
        lever[at] = np.einsum("tij,tnj->tni", further, lever[at])
        swing[at] = further @ swing[at]
    return matrix_vectors(swing)


def _heights(points: FloatArray, body: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how high points are above a surface [m], inf far from it, (T, N), and the normals there, (T, N, 3).

    The surface is known by places and normals; heights above their planes are averaged, near ones counting most, so
    that they change without a jump (Kolluri 2008, "Provably good moving least squares").
    """
    square = (
        np.einsum("tni,tni->tn", points, points)[:, :, None]
        - 2.0 * points @ np.swapaxes(body, -1, -2)
        + np.einsum("tmi,tmi->tm", body, body)[:, None]
    )
    nearest = square.min(axis=2, keepdims=True)
    share = np.exp((nearest - square) / _SPACING_M**2)
    share /= share.sum(axis=2, keepdims=True)
    normal = share @ normals
    planes = np.einsum("tmi,tmi->tm", body, normals)
    height = np.einsum("tni,tni->tn", points, normal) - (share @ planes[:, :, None])[:, :, 0]
    return np.where(nearest[:, :, 0] < _REACH_M**2, height, np.inf), normal


def _spread(vertices: NDArray[np.int64], places: FloatArray) -> NDArray[np.int64]:
    """Return one of these vertices for each cube of the spacing that holds any."""
    cubes = np.floor(places[vertices] / _SPACING_M).astype(np.int64)
    return vertices[np.unique(cubes, axis=0, return_index=True)[1]]
