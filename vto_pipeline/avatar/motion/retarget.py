"""From a clip of any skeleton to the motion of an avatar, with feet that stand where they stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.avatar.motion.align import carry_over
from vto_pipeline.avatar.motion.balance import Balance, balance
from vto_pipeline.avatar.motion.calm import calm, calm_on_held_feet
from vto_pipeline.avatar.motion.figures import jerked_joints, plant_drift, spikes, worst_leap
from vto_pipeline.avatar.motion.foot_skate import grounded
from vto_pipeline.avatar.motion.hips_aside import balanced
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.limits import limit_turns
from vto_pipeline.avatar.motion.plants import find_plants, runs, speeds
from vto_pipeline.avatar.motion.room.parts import Arms, Legs, Trunk
from vto_pipeline.avatar.motion.soles import contact_places
from vto_pipeline.avatar.motion.timing import lead_in, resample
from vto_pipeline.io.motion.joint_map import JointMap
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import AvatarMotion, Clip
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.kinematics import local_rotations, matrix_vectors

_OFTEN = 0.05
_DRIFT_M = 0.002
_BALANCED = 0.7
_ON_THE_SPOT_M_S, _SLIDES_M_S = 0.2, 0.4


class RetargetConfig(Config):
    """Settings of the retargeting."""

    frames_per_second: float = Field(default=0.0, ge=0.0, le=240.0, description="Of the result; 0 keeps the clip's")
    hold_feet: bool = Field(default=True, description="Whether feet that stand still are held where they stand")
    hips_aside_mm: float = Field(
        default=0.0, ge=0.0, le=300.0, description="How far hips may move aside to keep the balance [mm]; 0: not at all"
    )
    lead_in_s: float = Field(
        default=0.0, ge=0.0, le=10.0, description="Time from the avatar's own pose to the first frame [s]"
    )


@dataclass(frozen=True)
class MotionFigures:
    """How a motion came out.

    Args:
        plants: Number of times a heel or ball stands still.
        drift_before: Farthest that one of them strays, before the feet are held [m].
        drift_after: The same after.
        spikes_before: Frames in which a joint is jerked, before.
        spikes_after: The same after.
        below_floor: Deepest that a heel or ball dips below the floor [m].
        balance: The zero moment point.
        limited: Joint -> share of frames in which its turn was limited.
        arms_moved: Share of frames in which an arm had no room beside the body, and was moved off it.
    """

    plants: int
    drift_before: float
    drift_after: float
    spikes_before: int
    spikes_after: int
    below_floor: float
    balance: Balance
    limited: dict[str, float]
    arms_moved: float


def retarget(
    clip: Clip, joints: JointMap, avatar: Avatar, config: RetargetConfig | None = None, job: Job | None = None
) -> tuple[AvatarMotion, MotionFigures]:
    """Return an avatar's motion after a clip, and how it came out.

    Args:
        clip: In metres, +Y up.
        joints: Of the clip.
        avatar: Any of our bodies.
        config: Settings.
        job: Receives the figures, and warnings about feet that slide, joints bent too far, and a body that would fall.

    Raises:
        InputError: the source stands neither at rest nor in its first frame, or too many frames are asked for.
    """
    config, job = config or RetargetConfig(), job or Job()
    if config.frames_per_second:
        clip = resample(clip, config.frames_per_second)
    job.progress(0.1, f"carry over {len(clip.rotations)} frames")
    turn, root = carry_over(clip, joints, avatar, job)
    poses = matrix_vectors(local_rotations(avatar.parents.tolist(), turn))
    poses, limited = limit_turns(poses, avatar.joint_names)
    turn, place = posed_joints(avatar, poses, root)
    before = contact_places(turn, place, avatar)
    spikes_before, leap = spikes(place, clip.frame_time), worst_leap(place, clip.frame_time)
    poses, root = calm(avatar, poses, root, clip.frame_time)
    calmed = contact_places(*posed_joints(avatar, poses, root), avatar)
    planted = find_plants(calmed, clip.frame_time)
    job.progress(0.3, "keep the limbs off the body")
    poses, root, planted, arms_moved = _mended(avatar, poses, root, planted, clip.frame_time, config)
    turn, place = posed_joints(avatar, poses, root)
    after = contact_places(turn, place, avatar)
    job.progress(0.7, "find the zero moment point")
    figures = MotionFigures(
        plants=sum(len(runs(column)) for column in planted.T),
        drift_before=plant_drift(before, planted),
        drift_after=plant_drift(after, planted),
        spikes_before=spikes_before,
        spikes_after=spikes(place, clip.frame_time),
        below_floor=float(max(-after[..., 1].min(), 0.0)),
        balance=balance(turn, place, avatar, clip.frame_time),
        limited=limited,
        arms_moved=arms_moved,
    )
    _report(figures, before, place, clip.frame_time, job)
    if leap is not None:
        joint = avatar.joint_names[leap.joint].replace("_", " ")
        job.warn(
            f"the motion leaps at {leap.frame * clip.frame_time:.2f} s: {joint} by {1e3 * leap.distance:.0f} mm "
            "from one frame to the next; frames may be missing there"
        )
    pelvis = avatar.joints[avatar.joint_names.index("pelvis")]
    motion = AvatarMotion(avatar.joint_names, poses, root - pelvis, planted, clip.frame_time)
    if config.lead_in_s:
        motion = lead_in(motion, avatar, config.lead_in_s)
    return motion, figures


def _mended(
    avatar: Avatar,
    poses: FloatArray,
    root: FloatArray,
    planted: NDArray[np.bool_],
    frame_time: float,
    config: RetargetConfig,
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], float]:
    """Return a motion whose feet stand, whose limbs have room, and that is calm.

    Feet that stand in a leg are set down beside it; where they stand, only the leg that is in the air goes around.

    Args:
        avatar: Any of our bodies.
        poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
        root: Places of the root [m], shape (T, 3).
        planted: Which of `model.motion.CONTACTS` stand still, shape (T, 4).
        frame_time: [s].
        config: Whether feet are held, and how far hips may move aside.

    Returns:
        Poses, places of the root, what is planted, and the share of frames in which an arm had no room.
    """
    hold = config.hold_feet
    both = np.ones((len(poses), 2))
    stands = grounded(planted, frame_time) if hold else 0.0 * both
    poses, _ = Legs(avatar).kept(poses, root, _halves(both * stands.prod(axis=1, keepdims=True)), frame_time)
    if hold:
        poses, root, planted = calm_on_held_feet(avatar, poses, root, planted, frame_time)
        stands = grounded(planted, frame_time)
    free = _halves(1.0 - stands)
    poses, around, close = _with_room(avatar, poses, root, free, frame_time)
    if config.hips_aside_mm:
        poses, root = balanced(avatar, poses, root, frame_time, 1e-3 * config.hips_aside_mm)
        poses, again, _ = _with_room(avatar, poses, root, free, frame_time)
        around = around | again
    if hold and (around.any() or jerked_joints(posed_joints(avatar, poses, root)[1], frame_time).any()):
        poses, root, planted = calm_on_held_feet(avatar, poses, root, planted, frame_time)
    elif not hold:
        poses, root = calm(avatar, poses, root, frame_time)
    return poses, root, planted, float(close.mean())


def _with_room(
    avatar: Avatar, poses: FloatArray, root: FloatArray, free: FloatArray, frame_time: float
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return poses with legs that are free kept off each other, the trunk off them, and arms off all.

    Args:
        avatar: Any of our bodies.
        poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
        root: Places of the root [m], shape (T, 3).
        free: How much of the way each leg goes, shape (T, 2).
        frame_time: [s].

    Returns:
        Poses, and the frames in which a leg and an arm had no room, shape (T,).
    """
    poses, around = Legs(avatar).kept(poses, root, free, frame_time)
    poses, _ = Trunk(avatar).kept(poses, root, np.ones((len(poses), 1)), frame_time)
    poses, close = Arms(avatar).kept(poses, root, np.ones((len(poses), 2)), frame_time)
    return poses, around, close


def _halves(free: FloatArray) -> FloatArray:
    """Return how much of the way each of two legs goes: half, where both are free, shape (T, 2)."""
    shared: FloatArray = free / np.maximum(free.sum(axis=1, keepdims=True), 1.0)
    return shared


def _report(figures: MotionFigures, contacts: FloatArray, place: FloatArray, frame_time: float, job: Job) -> None:
    share = figures.balance.inside_share
    job.measure(
        plants=figures.plants,
        drift_before_mm=1e3 * figures.drift_before,
        drift_after_mm=1e3 * figures.drift_after,
        spikes_before=figures.spikes_before,
        spikes_after=figures.spikes_after,
        below_floor_mm=1e3 * figures.below_floor,
        balanced_share=share,
    )
    often = {name: part for name, part in figures.limited.items() if part > _OFTEN}
    if often:
        said = ", ".join(f"{name} {part:.0%}" for name, part in sorted(often.items(), key=lambda one: -one[1]))
        job.warn(f"joints bent further than people can, in a share of the frames, were limited: {said}")
    if figures.arms_moved:
        job.note(f"arms were moved off the body in {figures.arms_moved:.0%} of the frames")
    if figures.drift_after > _DRIFT_M and figures.plants:
        job.warn(f"planted feet drift by up to {1e3 * figures.drift_after:.1f} mm: a leg does not reach")
    if figures.spikes_after > figures.spikes_before:
        job.warn(f"{figures.spikes_after - figures.spikes_before} more frames with a jerk than before")
    if share is not None and share < _BALANCED:
        job.warn(
            f"the zero moment point lies outside of the feet in {1 - share:.0%} of the frames on the floor: "
            "a person who moves like this would stumble"
        )
    if figures.plants == 0 and len(contacts) > 2:
        pelvis = float(np.linalg.norm(place[-1, 0] - place[0, 0])) / ((len(place) - 1) * frame_time)
        lowest = contacts[..., 1].argmin(axis=1)
        slide = float(np.median(speeds(contacts, frame_time)[np.arange(len(lowest)), lowest]))
        if pelvis < _ON_THE_SPOT_M_S and slide > _SLIDES_M_S:
            job.warn(f"no foot stands still: it walks on the spot, on a floor that moves by {slide:.1f} m/s")
        else:
            job.note("no foot stands still on the floor")
