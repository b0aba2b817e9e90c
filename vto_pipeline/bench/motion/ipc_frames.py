"""Frames of a garment in motion in which it crosses, by ipctk, which is none of ours."""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.motion.path import avatar_path
from vto_pipeline.bench.drape.ipc_crossings import crossings
from vto_pipeline.cloth.collision.body.yielding import YieldingBody
from vto_pipeline.cloth.dynamics.body_motion import beside
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import AvatarMotion, ClothMotion


def crossing_frames(cloth: ClothMotion, avatar: Avatar, motion: AvatarMotion) -> tuple[int, int]:
    """Return in how many frames cloth crosses itself or its body: the body with sunken skin, then as it is posed.

    Where parts of a body press on each other its skin sinks in, and cloth is held off that. The posed skin there passes
    through itself, and through cloth in between.

    Args:
        cloth: The frames.
        avatar: Its body.
        motion: Of that body.
    """
    path = avatar_path(avatar, motion)
    first = TriangleMesh(cloth.frames[0], cloth.faces)
    ends = first.vertices[edges(first)]
    skin = default_skin(float(np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))))
    sunken = YieldingBody(path, skin, beside(path.at(0.0), first)).path
    counts = [0, 0]
    for number, frame in enumerate(cloth.frames):
        there = TriangleMesh(frame, cloth.faces)
        for k, body in enumerate((sunken, path)):
            counts[k] += crossings(there, TriangleMesh(body.at(body.time(number)), body.faces)) > 0
    return counts[0], counts[1]
