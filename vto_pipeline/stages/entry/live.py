"""The avatar and the garment of a finished run, moved by a person before a camera."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vto_pipeline.avatar.model.pose import posed_vertices
from vto_pipeline.avatar.motion.live import LivePose
from vto_pipeline.cloth.model.coarsening import coarsen
from vto_pipeline.cloth.moving.live import LiveCloth
from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.geometry.riding.binding import Binding, apply, bind
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.motion.tracked.feed import Feed
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.render.dress import BODY
from vto_pipeline.report.layers import PageLayer, list_layers
from vto_pipeline.report.live.page import LivePage, live_page
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.entry.pace import Pace

_SHORTEST, _LONGEST = 0.5, 3.0
"""Frames' lengths that a frame counts as: at least, where frames catch up, and at most, as a pause is no leap."""
_MORE = 1.15  # times the vertices that were asked for: with fewer, a garment is taken as it is
_NOBODY_S = 0.2  # between looks whether somebody has come


@dataclass(frozen=True)
class Worn:
    """What a run made that can move.

    Args:
        avatar: As it stands in the run.
        garment: On it, coarse enough.
        fabric: Of the garment.
        layers: What is shown: the garment, and the body last.
    """

    avatar: Avatar
    garment: Garment
    fabric: Fabric
    layers: tuple[PageLayer, ...]

    @cached_property
    def page(self) -> LivePage:
        """The page that shows it."""
        return live_page("The garment, live", self.layers)

    @cached_property
    def _riding(self) -> Binding:
        return bind(self.layers[0].mesh, self.garment.mesh)

    def shown(self, cloth: FloatArray, body: FloatArray) -> FloatArray:
        """Return a frame of the page: places of all its vertices, for those of cloth and body [m]."""
        garment, skin = self.page.sources
        return np.concatenate([apply(self._riding, cloth)[garment], body[skin]])


def worn(outcome: Outcome, vertices: int) -> Worn:
    """Return what moves, of a run.

    Args:
        outcome: Of `vto drape` on an avatar.
        vertices: About how many the cloth may have.

    Raises:
        InputError: it made no draped garment, several, or has no avatar.
    """
    if not outcome.made("draped"):
        hint = "`vto drape` with one garment"
        raise InputError("this run made no draped garment of its own", where=str(outcome.folder), hint=hint)
    if not outcome.made("avatar"):
        hint = "`vto fit` makes one of a scan or measurements; drape on that"
        raise InputError("this run was draped on a body that is not an avatar", where=str(outcome.folder), hint=hint)
    avatar, draped = outcome.read("avatar"), outcome.read("draped")
    garment = Garment(draped, outcome.read("worn_rest"))
    if len(draped.vertices) > _MORE * vertices:
        garment = coarsen(garment, vertices).garment
    parts: dict[str, Any] = {"draped": draped, "worn_by": avatar.mesh}
    if outcome.made("render_mesh"):
        parts["render_mesh"] = [part for part in outcome.read("render_mesh") if part.name != BODY]
    layers = list_layers(parts)
    given = outcome.record["given"]["fabric"]
    fabric = read_fabric(given.get("path") or given["value"])
    return Worn(avatar, garment, fabric, (layers[0], layers[-1]))


@dataclass
class LiveReport:
    """How it went.

    Args:
        seconds: From the first skeleton to the end [s].
        late: Frames that were left out, as the one before took too long.
        held: Frames for which there was no new skeleton.
        frame_s: What each frame took [s].
    """

    seconds: float = 0.0
    late: int = 0
    held: int = 0
    frame_s: list[float] = field(default_factory=list)

    def figures(self, cloth: LiveCloth, feed: Feed) -> dict[str, Any]:
        """Return it as JSON values."""
        took = 1e3 * np.array(self.frame_s or [0.0])
        return {
            "frames": len(self.frame_s),
            "seconds": self.seconds,
            "frames_per_second": len(self.frame_s) / self.seconds if self.seconds else 0.0,
            "frame_ms_median": float(np.median(took)),
            "frame_ms_p95": float(np.quantile(took, 0.95)),
            "late": self.late,
            "held": self.held,
            "skeletons": feed.frames,
            "skeletons_skipped": feed.skipped,
            "lines_refused": feed.refusals,
            "vertices": len(cloth.positions),
            "penetration_mm": 1e3 * cloth.deepest,
            "restarts": cloth.restarts,
        }


def follow_live(
    dressed: Worn,
    cloth: LiveCloth,
    pose: LivePose,
    feed: Feed,
    rate: float,
    show: Callable[[FloatArray], None],
    report: LiveReport,
) -> None:
    """Move the avatar and its garment until the feed is over.

    A frame takes the newest skeleton, or holds the last. Frames come at even times (see `Pace`), and each is as long as
    it is since the one before.

    Args:
        dressed: What moves.
        cloth: Its garment, on the way.
        pose: What the avatar does.
        feed: Of skeletons.
        rate: Frames a second.
        show: Called with each frame of the page [m].
        report: Filled in as it goes.

    Raises:
        FormatError, InputError: the first skeleton is none of a person.
    """
    show(dressed.shown(cloth.positions, dressed.avatar.vertices))
    frame = None
    while frame is None and not feed.over:
        frame = feed.take(_NOBODY_S)
    period, body = 1.0 / rate, dressed.avatar.vertices
    first = before = time.perf_counter()
    pace = Pace(period, first)
    while not feed.over or frame is not None:
        began = time.perf_counter()
        if frame is not None:
            body = posed_vertices(dressed.avatar, *pose.at(frame.places, began - first))
        report.held += frame is None
        cloth.advance(body, min(max(began - before, _SHORTEST * period), _LONGEST * period))
        before = began
        show(dressed.shown(cloth.positions, body))
        now = time.perf_counter()
        report.frame_s.append(now - began)
        report.late += pace.made(now)
        time.sleep(max(0.0, pace.due - now))
        report.seconds = time.perf_counter() - first
        frame = feed.take()
    if not report.frame_s:
        waits = f": {', '.join(feed.waits_for)} were not seen" if feed.frames == 0 and feed.waits_for else ""
        raise FormatError(f"no frame with a whole person came{waits}", hint="lines as `vto motion -` takes them")
