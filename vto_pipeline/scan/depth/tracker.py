"""How a depth camera moved between any two of its frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.depth import frame_color, frame_depth
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.depth.depth_mask import clean_depth
from vto_pipeline.scan.depth.pose_graph import Edge
from vto_pipeline.scan.depth.pose_guess import ImageFeatures, find_features, guess_motion
from vto_pipeline.scan.depth.rgbd_alignment import RgbdAlignment, align_frames
from vto_pipeline.scan.depth.rgbd_frame import RgbdFrame, prepare_frame

MIN_READINGS = 1000
"""Of a frame; with fewer there is nothing to hold on to."""


@dataclass(frozen=True)
class TrackedFrame:
    """A frame ready to be tracked.

    Args:
        index: Among the frames.
        surface: For alignment.
        features: For a first guess.
    """

    index: int
    surface: RgbdFrame
    features: ImageFeatures


class Tracker:
    """Reads frames and tracks one to another.

    Args:
        frames: Depth and, if there is any, colour.
        min_overlap: Share of a frame's points that must fit the other's.
        max_jump: Points further apart than this do not match [m].
    """

    def __init__(self, frames: DepthFrameSet, min_overlap: float, max_jump: float) -> None:
        self.frames, self.min_overlap, self.max_jump = frames, min_overlap, max_jump

    def read(self, chosen: Sequence[int]) -> Iterator[TrackedFrame | None]:
        """Give some frames in order, None for one that holds next to no readings; few are in memory at a time."""
        return in_order(lambda k: self._try_prepare(chosen[k]), len(chosen))

    def prepare(self, index: int) -> TrackedFrame:
        """Read one frame.

        Raises:
            ScanError: it holds next to no readings.
        """
        frames = self.frames
        path, camera = frames.depth_paths[index], frames.intrinsics
        depth = clean_depth(frame_depth(frames, index), camera)
        if np.count_nonzero(depth) < MIN_READINGS:
            problem = f"{np.count_nonzero(depth)} usable depth readings; at least {MIN_READINGS} are needed"
            raise ScanError(problem, where=str(path))
        color = frame_color(frames, index)
        return TrackedFrame(index, prepare_frame(color, depth, camera), find_features(color, depth, camera))

    def _try_prepare(self, index: int) -> TrackedFrame | None:
        try:
            return self.prepare(index)
        except ScanError:
            return None

    def track(self, source: TrackedFrame, target: TrackedFrame, steady: FloatArray) -> Edge:
        """Track one frame to another: from matched features, or where these are too few from a steady motion.

        Raises:
            ScanError: too little of the two frames fits together.
        """
        paths = self.frames.depth_paths
        where = f"{paths[source.index].name} to {paths[target.index].name}"
        hint = "move more slowly, keep the object filling the frame, and use textured fabric"
        guess = guess_motion(source.features, target.features, self.frames.intrinsics)
        try:
            found = align_frames(source.surface, target.surface, steady if guess is None else guess, self.max_jump)
        except ScanError as e:
            raise ScanError(e.problem, where=where, hint=hint) from None
        if found.overlap < self.min_overlap:
            wanted = f"{100 * self.min_overlap:.0f} % needed"
            problem = f"lost track: {100 * found.overlap:.0f} % of the points fit; {wanted}"
            raise ScanError(problem, where=where, hint=hint)
        return _edge(source, target, found, guess is not None)

    def try_track(self, source: TrackedFrame, target: TrackedFrame, steady: FloatArray) -> Edge | None:
        """As `track`, for an edge that may not exist: shape alone would confirm any turn of a round garment."""
        try:
            edge = self.track(source, target, steady)
        except ScanError:
            return None
        return edge if edge.confirmed or not self.frames.color_paths else None


def _edge(source: TrackedFrame, target: TrackedFrame, found: RgbdAlignment, confirmed: bool) -> Edge:
    return Edge(source.index, target.index, found.target_from_source, found.information, found.overlap, confirmed)
