"""An avatar that does what a person before a camera does, frame by frame.

What `retarget` learns from the whole motion, the lengths of bones, the floor and how feet stand, is measured over the
first frames, anew with each of them, and then kept. Feet are not held: that would need the frames to come.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from vto_pipeline.avatar.motion.align import Fit, carried, fit_of
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.limits import limit_turns
from vto_pipeline.avatar.motion.room.parts import Arms
from vto_pipeline.avatar.motion.timing import brought_to
from vto_pipeline.io.motion.joint_map import JointMap
from vto_pipeline.io.motion.read import clip_of, understood
from vto_pipeline.io.motion.standard_skeleton import standard_skeleton
from vto_pipeline.io.motion.tracked.parse import carried_by_feet, moving_skeleton
from vto_pipeline.io.motion.tracked.turns import fitted_skeleton, turns_of
from vto_pipeline.io.motion.upright import to_y
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import CONTACTS, AvatarMotion, Clip
from vto_pipeline.numerics.kinematics import local_rotations, matrix_vectors, vector_matrices

_MEASURED = 30
"""Frames over which the person is measured: a second of a usual camera."""
_FRAME_S = 1.0 / _MEASURED
_AT_ORIGIN_M = 1e-3
"""Hips that never leave the origin by more are the origin: places count from them."""
_LEAP_M, _LEAP_RAD = 0.4, 1.5
"""From one frame to the next: nobody goes so far, or turns a joint so far; it is another person, or a loss."""
_OUT_S, _BACK_S = 0.04, 0.2
"""In which an arm goes most of the way off the body, and back to where the person's is."""

Places = Mapping[str, FloatArray]


class LivePose:
    """Carries one frame after another over to an avatar.

    Args:
        avatar: As it stands when the first frame comes.
        lead_in: Time from its own pose to the person's, and to a person's who has leapt [s].
        unit, up: As for `read_motion`.
        job: Notified of what was guessed.
    """

    def __init__(
        self, avatar: Avatar, lead_in: float, *, unit: str | None = None, up: str | None = None, job: Job | None = None
    ) -> None:
        self._avatar = avatar
        self._lead_in = lead_in
        self._unit, self._up = unit, up
        self._job = job or Job()
        self._from, self._since = (vector_matrices(avatar.pose), avatar.translation), 0.0
        self._wanted: tuple[FloatArray, FloatArray] | None = None
        self._metric: FloatArray | None = None
        self._joints: JointMap
        self._offsets: FloatArray
        self._fit: Fit
        self._first: tuple[FloatArray, FloatArray]
        self._seen: list[Places] = []
        self._last: Places = {}
        self._arms, self._swings, self._swung = Arms(avatar), np.zeros((2, 3)), 0.0
        self._walked = np.zeros(3)

    def at(self, places: Places, seconds: float) -> tuple[FloatArray, FloatArray]:
        """Return the avatar's pose and translation, as `pose_avatar` takes them.

        Args:
            places: Of the joints in a frame, as `LiveJoints` gives them.
            seconds: Since the first frame [s].

        Raises:
            FormatError, InputError: as `read_motion` and `retarget`, of the first frame.
        """
        places = self._upright(places)
        if len(self._seen) < _MEASURED:
            self._seen.append(places)
            posed = self._measured()
        else:
            posed = self._posed(places)
        poses, translations = self._off_body(*posed, seconds)
        motion = AvatarMotion(
            self._avatar.joint_names,
            np.stack([self._first[0], poses]),
            np.stack([self._first[1], translations]),
            np.zeros((2, len(CONTACTS)), dtype=bool),
            _FRAME_S,
        )
        brought, moved = brought_to(motion, self._avatar)
        wanted = vector_matrices(brought[1]), moved[1]
        if self._wanted is not None and _leaps(self._wanted, wanted):
            self._from, self._since = self._led_in(self._wanted, seconds), seconds
        self._wanted = wanted
        turns, translation = self._led_in(wanted, seconds)
        return matrix_vectors(turns), translation

    def _upright(self, places: Places) -> Places:
        """Return places in metres, +Y up; where they count from the hips, the foot that stands carries the body."""
        if self._metric is None:
            clip = _skeleton({name: place[None] for name, place in places.items()})
            read = understood(clip, Path("first frame"), self._unit, self._up, self._job)
            self._joints = read.joints
            self._metric = read.axes.metres * to_y(read.axes.up)
        found = {name: self._metric @ place for name, place in places.items()}
        if np.linalg.norm(found["left_hip"] + found["right_hip"]) < 2.0 * _AT_ORIGIN_M:
            if self._last:
                steps = {name: np.stack([self._last[name], found[name]]) for name in found if name in self._last}
                self._walked = self._walked + carried_by_feet(steps)[-1]
            self._last = found
            found = {name: place + self._walked for name, place in found.items()}
        return found

    def _measured(self) -> tuple[FloatArray, FloatArray]:
        """Measure the person over the frames so far; return pose and translation in the last of them, as `_posed`."""
        window = {
            name: np.stack([places[name] for places in self._seen])
            for name in self._seen[0]
            if all(name in places for places in self._seen)
        }
        arrays = _skeleton(window)
        self._offsets, clip = arrays["offsets"], clip_of(arrays)
        self._fit = fit_of(clip, self._joints, self._avatar, Job())
        ends = [0, -1]  # together: a frame more costs next to nothing
        poses, places = self._carried(
            replace(clip, rotations=clip.rotations[ends], translations=clip.translations[ends])
        )
        self._first = poses[0], places[0]
        return poses[1], places[1]

    def _posed(self, places: Places) -> tuple[FloatArray, FloatArray]:
        """Return pose and translation where the person is, in front of the camera."""
        known = {name: place[None] for name, place in places.items() if name in self._seen[0]}
        poses, translations = self._carried(clip_of(_skeleton(known, self._offsets)))
        return poses[0], translations[0]

    def _carried(self, clip: Clip) -> tuple[FloatArray, FloatArray]:
        """Return poses and translations of the avatar in some frames, shapes (T, J, 3) and (T, 3)."""
        turn, root = carried(clip, self._joints, self._avatar, self._fit)
        poses = matrix_vectors(local_rotations(self._avatar.parents.tolist(), turn))
        poses, _ = limit_turns(poses, self._avatar.joint_names)
        return poses, root - self._avatar.joints[self._avatar.joint_names.index("pelvis")]

    def _off_body(self, poses: FloatArray, translation: FloatArray, seconds: float) -> tuple[FloatArray, FloatArray]:
        """Return a pose whose arms are kept off the body; they go out of the way fast, and come back slowly."""
        pelvis = self._avatar.joints[self._avatar.joint_names.index("pelvis")]
        turn, place = posed_joints(self._avatar, poses[None], (translation + pelvis)[None])
        needed = self._arms.swings(turn, place)[0]
        returns = np.linalg.norm(self._swings, axis=1) > np.linalg.norm(needed, axis=1)
        left = np.exp((self._swung - seconds) / np.where(returns, _BACK_S, _OUT_S))
        self._swings, self._swung = needed + left[:, None] * (self._swings - needed), seconds
        turn = self._arms.swung(turn, self._swings[None])
        return matrix_vectors(local_rotations(self._avatar.parents.tolist(), turn))[0], translation

    def _led_in(self, wanted: tuple[FloatArray, FloatArray], seconds: float) -> tuple[FloatArray, FloatArray]:
        """Return turns of the joints and translation between where the lead-in begins and what is wanted."""
        if seconds - self._since >= self._lead_in:
            return wanted
        share = (seconds - self._since) / self._lead_in
        share = share * share * (3.0 - 2.0 * share)
        turns, translation = self._from
        way = matrix_vectors(wanted[0] @ np.swapaxes(turns, -1, -2))
        return vector_matrices(share * way) @ turns, (1.0 - share) * translation + share * wanted[1]


def _leaps(before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray]) -> bool:
    """Return whether the way from one to the other, turns and translation each, is too far for a frame."""
    turned = np.linalg.norm(matrix_vectors(np.swapaxes(before[0], -1, -2) @ after[0]), axis=1)
    return bool(np.linalg.norm(after[1] - before[1]) > _LEAP_M or turned.max() > _LEAP_RAD)


def _skeleton(places: Places, offsets: FloatArray | None = None) -> dict[str, np.ndarray]:
    """Return a skeleton whose joints are there, shape (T, 3) each; its bones as measured before, or as they are."""
    parents, bones = fitted_skeleton(places) if offsets is None else (standard_skeleton()[0], offsets)
    return moving_skeleton(parents, bones, *turns_of(places, bones), _FRAME_S)
