"""Stages of a motion: the avatar moves, and the draped garment with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field

from vto_pipeline.assess.motion import assess_motion
from vto_pipeline.avatar.motion.path import avatar_path
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.motion.timing import hold_last
from vto_pipeline.avatar.template.regions import part_names
from vto_pipeline.cloth.moving.config import FollowConfig
from vto_pipeline.cloth.moving.follow import follow
from vto_pipeline.cloth.rest_shape.edge_length_embedding import lengths_in_space
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.io.gltf.animate import animated_glb
from vto_pipeline.io.runs.frame_log import FrameLog
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import AvatarMotion, ClothMotion
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]

_SHOWN = 150
"""Frames on a page, at most: five seconds of all of them."""
_SAME_M = 1e-3
"""How far the posed avatar may be from the body that was draped on before it is worth a warning."""


class MoveConfig(RetargetConfig):
    """Settings of the avatar's motion."""

    frames_per_second: float = Field(
        default=30.0, ge=0.0, le=240.0, description="Of the frames that are kept; 0 keeps the motion's own"
    )
    lead_in_s: float = Field(
        default=1.0, ge=0.05, le=10.0, description="Time from the pose that was draped in to the first frame [s]"
    )
    hold_s: float = Field(default=0.5, ge=0.0, le=60.0, description="Time that the last pose is held [s]")


class MotionFitConfig(Config):
    """Settings of the fit over a motion."""

    stretch_limit: float = Field(
        default=0.05, gt=0.0, le=1.0, description="Stretch beyond rest that counts as too much, as a share of length"
    )


def _move(inputs: Inputs, settings: MoveConfig, job: Job) -> Outputs:
    read, avatar = inputs["motion"], inputs["avatar"]
    motion, _ = retarget(read.clip, read.joints, avatar, settings, job)
    motion = hold_last(motion, settings.hold_s)
    off = float(np.linalg.norm(avatar_path(avatar, motion).at(0.0) - avatar.vertices, axis=1).max())
    if off > _SAME_M:
        job.warn(f"the motion begins up to {1e3 * off:.0f} mm from the pose that the garment was draped in")
    return {"avatar_motion": motion}


def _follow(inputs: Inputs, settings: FollowConfig, job: Job) -> Outputs:
    garment = Garment(inputs["draped"], inputs["worn_rest"])
    path = avatar_path(inputs["avatar"], inputs["avatar_motion"])
    frames, found = follow(garment, path, inputs["fabric"], settings, job, FrameLog(job.kept))
    return {"draped_motion": frames, "motion_audit": found}


def _assess_motion(inputs: Inputs, settings: MotionFitConfig, job: Job) -> Outputs:
    avatar, cloth = inputs["avatar"], inputs["draped_motion"]
    path = avatar_path(avatar, inputs["avatar_motion"])
    bodies = (TriangleMesh(path.at(float(time)), path.faces) for time in cloth.times)
    rest = lengths_in_space(inputs["worn_rest"], TriangleMesh(cloth.frames[0], cloth.faces))
    report, maps = assess_motion(cloth, rest, bodies, part_names(avatar), settings.stretch_limit, job)
    return {"motion_report": report, "motion_maps": maps}


def _animate(inputs: Inputs, settings: Config, job: Job) -> Outputs:
    cloth, lifelike = inputs["draped_motion"], inputs.get("lifelike_body")
    avatar, colors = (inputs["avatar"], None) if lifelike is None else (lifelike.avatar, lifelike.colors)
    normals = vertex_normals(TriangleMesh(avatar.bind_vertices, avatar.faces))
    made, error = animated_glb(avatar, normals, inputs["avatar_motion"], cloth, colors)
    job.measure(cloth_error_mm=1e3 * error)
    return {"moving_scene": made}


def shown_motion(cloth: ClothMotion, avatar: Avatar, motion: AvatarMotion) -> tuple[ClothMotion, ClothMotion]:
    """Return the frames of garment and body that a page has room for: all, or every second, or fewer."""
    every = -(-len(cloth.frames) // _SHOWN)
    path, kept = avatar_path(avatar, motion), cloth.frames[::every]
    body = np.stack([path.at(every * frame * cloth.frame_time) for frame in range(len(kept))])
    return (
        ClothMotion(kept, cloth.faces, every * cloth.frame_time),
        ClothMotion(body, path.faces, every * cloth.frame_time),
    )


STAGES: tuple[Stage, ...] = (
    Stage(
        name="move",
        about="the motion carried over to the avatar, from the pose it is draped in",
        needs=("avatar", "motion"),
        makes=("avatar_motion",),
        run=_move,
        settings=MoveConfig,
        uses=("scipy",),
    ),
    Stage(
        name="follow",
        about="the draped garment, carried through the avatar's motion",
        needs=("draped", "worn_rest", "fabric", "avatar", "avatar_motion"),
        makes=("draped_motion", "motion_audit"),
        run=_follow,
        settings=FollowConfig,
        piecewise=True,
        uses=("numba", "libigl"),
    ),
    Stage(
        name="assess_motion",
        about="where the garment gets tight in the motion, and when",
        needs=("draped_motion", "worn_rest", "avatar", "avatar_motion"),
        makes=("motion_report", "motion_maps"),
        run=_assess_motion,
        settings=MotionFitConfig,
        uses=("libigl",),
    ),
    Stage(
        name="animate",
        about="avatar and garment in motion, in a file for viewers",
        needs=("avatar", "avatar_motion", "draped_motion"),
        optional=("lifelike_body",),
        makes=("moving_scene",),
        run=_animate,
        uses=("pygltflib",),
    ),
)
