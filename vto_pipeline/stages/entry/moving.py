"""The garment and the avatar of a run in motion, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vto_pipeline.avatar.motion.path import avatar_path
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath, ClothMotion
from vto_pipeline.render.clear_body import outside
from vto_pipeline.render.tint import SKIN, tint
from vto_pipeline.render.transfer import Binding, apply, bind
from vto_pipeline.render.tuck import tuck
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.entry.shown import shown_artifacts, shown_meshes


@dataclass(frozen=True)
class MovingScene:
    """A garment and the body that wears it.

    Args:
        garment: Surfaces as draped, in full detail where the run made that [m].
        draped: The simulation mesh there [m].
        cloth: Its frames.
        body: The avatar on its way.
        lifelike: The lifelike body on the same way, and its colours, shape (V, 3); None: the avatar is shown.
    """

    garment: tuple[TriangleMesh, ...]
    draped: TriangleMesh
    cloth: ClothMotion
    body: BodyPath
    lifelike: tuple[BodyPath, ByteArray] | None = None

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.cloth.frames)

    @property
    def frames_per_second(self) -> float:
        """Of the motion."""
        return 1.0 / self.cloth.frame_time

    def at(self, frame: int) -> list[TriangleMesh]:
        """Return the surfaces in a frame, the garment first [m]."""
        time, cloth = frame * self.cloth.frame_time, TriangleMesh(self.cloth.frames[frame], self.cloth.faces)
        body = tint(TriangleMesh(self.body.at(time), self.body.faces), SKIN)
        if self.lifelike is not None:
            path, colors = self.lifelike
            body = tuck(TriangleMesh(path.at(time), path.faces, colors), body, [cloth])
        there = self.cloth.frames[frame]
        worn = [replace(mesh, vertices=apply(one, there)) for mesh, one in zip(self.garment, self._bound, strict=True)]
        clear = outside(worn, body)
        return [*(replace(mesh, vertices=place) for mesh, place in zip(worn, clear, strict=True)), body]

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and the highest corner of the box about all frames [m], each of shape (3,)."""
        ends = [self.cloth.frames.min(axis=(0, 1)), self.cloth.frames.max(axis=(0, 1))]
        for frame in range(len(self)):
            body = self.body.at(frame * self.cloth.frame_time)
            ends += [body.min(axis=0), body.max(axis=0)]
        return np.min(ends, axis=0), np.max(ends, axis=0)

    @cached_property
    def _bound(self) -> list[Binding]:
        return [bind(mesh, self.draped) for mesh in self.garment]


def moving_scene(outcome: Outcome) -> MovingScene:
    """Return what a run with a motion made.

    Raises:
        InputError: it made no garment in motion.
    """
    if not outcome.made("draped_motion"):
        raise InputError(
            "this run made no garment in motion", where=str(outcome.folder), hint="`vto drape --motion`, and let it end"
        )
    name = shown_artifacts(outcome, detailed=True)[0]
    motion = outcome.read("avatar_motion")
    body, lifelike = avatar_path(outcome.read("avatar"), motion), None
    if outcome.made("lifelike_body"):
        shown = outcome.read("lifelike_body")
        lifelike = avatar_path(shown.avatar, motion), shown.colors
    garment = tuple(shown_meshes(name, outcome.read(name)))
    return MovingScene(garment, outcome.read("draped"), outcome.read("draped_motion"), body, lifelike)
