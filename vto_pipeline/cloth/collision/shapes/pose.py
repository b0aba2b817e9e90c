"""Rigid poses and their paths through time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, freeze

Vector = tuple[float, float, float]
Turn = Sequence[float]
"""A rotation: vector along the axis, as long as the angle [rad] (3 numbers), or quaternion x, y, z, w (4)."""


class Pose(NamedTuple):
    """A rotation, then a shift: what is p in the thing's own frame is turn @ p + shift in the world.

    Args:
        turn: Rotation matrix, shape (3, 3).
        shift: [m], shape (3,).
    """

    turn: FloatArray
    shift: FloatArray

    def own(self, points: FloatArray) -> FloatArray:
        """Return points of the world [m], shape (..., 3), in the thing's own frame."""
        return (points - self.shift) @ self.turn

    def world(self, points: FloatArray) -> FloatArray:
        """Return points of the thing's own frame [m], shape (..., 3), in the world."""
        return self.world_direction(points) + self.shift

    def own_direction(self, directions: FloatArray) -> FloatArray:
        """Return directions of the world, shape (..., 3), in the thing's own frame."""
        return directions @ self.turn

    def world_direction(self, directions: FloatArray) -> FloatArray:
        """Return directions of the thing's own frame, shape (..., 3), in the world."""
        return directions @ self.turn.T


def pose(shift: ArrayLike, turn: Turn = (0.0, 0.0, 0.0)) -> Pose:
    """Return the pose of a thing.

    Raises:
        InputError: not three numbers, not finite, or no rotation.
    """
    return Pose(rotations("rotation", [turn]).as_matrix()[0], freeze("place", shift, (3,), "f8"))


def along_y(axis: ArrayLike) -> FloatArray:
    """Return a rotation matrix that takes +Y to this direction; the identity for +Y itself."""
    y = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    x = np.cross(y, np.eye(3)[2 if abs(y[2]) < 0.9 else 0])
    x /= np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


def rotations(name: str, turns: ArrayLike) -> Rotation:
    """Return rotations from vectors, shape (K, 3), or quaternions, shape (K, 4).

    Raises:
        InputError: neither, or a quaternion of length zero.
    """
    values = np.asarray(turns, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] not in (3, 4):
        raise InputError(f"{name}: shape {values.shape}; expected rotation vectors (K, 3) or quaternions (K, 4)")
    values = freeze(name, values, (None, values.shape[1]), "f8").copy()  # SciPy wants to be able to write
    if values.shape[1] == 3:
        return Rotation.from_rotvec(values)
    if not (np.linalg.norm(values, axis=1) > 0.0).all():
        raise InputError(f"{name}: a quaternion of length zero", hint="the identity is 0, 0, 0, 1")
    return Rotation.from_quat(values)


@dataclass(frozen=True)
class Path:
    """The path of a rigid body: straight and with an even turn from pose to pose, at rest before and after.

    Args:
        times: When each pose is reached [s], increasing, shape (K,).
        shifts: Where the thing's origin is then [m], shape (K, 3).
        turns: Its rotation about that origin, vectors (K, 3) [rad] or quaternions x, y, z, w (K, 4); none when None.

    Raises:
        InputError: shapes that do not match, or times that do not increase.
    """

    times: ArrayLike
    shifts: ArrayLike
    turns: ArrayLike | None = None

    def __post_init__(self) -> None:
        count = len(self._clock)
        if count == 0 or not (np.diff(self._clock) > 0.0).all():
            raise InputError("path: at least one time is needed, and times must increase")
        if len(self._places) != count or len(self._rotations) != count:
            found = f"{count} times, {len(self._places)} translations and {len(self._rotations)} rotations"
            raise InputError(f"path: {found}; expected as many of each")

    def at(self, time: float) -> Pose:
        """Return the pose at a time [s]."""
        clock = self._clock
        now = float(np.clip(time, clock[0], clock[-1]))
        shift = np.array([np.interp(now, clock, self._places[:, k]) for k in range(3)])
        turn = self._rotations[0] if len(clock) == 1 else self._turning(now)
        return Pose(turn.as_matrix(), shift)

    @cached_property
    def _clock(self) -> FloatArray:
        return freeze("path times", self.times, (None,), "f8")

    @cached_property
    def _places(self) -> FloatArray:
        return freeze("path translations", self.shifts, (None, 3), "f8")

    @cached_property
    def _rotations(self) -> Rotation:
        return rotations("path rotations", np.zeros((len(self._places), 3)) if self.turns is None else self.turns)

    @cached_property
    def _turning(self) -> Slerp:
        return Slerp(self._clock, self._rotations)
