"""How a depth camera moved between any two of its frames."""

from __future__ import annotations

import numpy as np

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.depth import read_depth
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.scan.depth.depth_mask import clean_depth
from vto_pipeline.scan.depth.pose_graph import Edge
from vto_pipeline.scan.depth.pose_guess import ImageFeatures, find_features, guess_motion
from vto_pipeline.scan.depth.rgbd_alignment import RgbdFrame, align_frames, prepare_frame

MIN_READINGS = 1000
"""Of a frame; with fewer there is nothing to hold on to."""


class Tracker:
    """Frames ready to align, and tracking between any two of them."""

    def __init__(self, frames: DepthFrameSet, min_overlap: float, max_jump: float) -> None:
        """Read and prepare all frames.

        Args:
            frames: Depth and, if there is any, colour.
            min_overlap: Share of a frame's readings that must fit the other's.
            max_jump: Readings further apart than this do not match [m].

        Raises:
            ScanError: a frame holds next to no readings.
        """
        self.frames, self.min_overlap, self.max_jump = frames, min_overlap, max_jump
        self.ready: list[RgbdFrame] = []
        self.features: list[ImageFeatures] = []
        for index, path in enumerate(frames.depth_paths):
            depth = clean_depth(read_depth(path, frames.depth_scale), frames.intrinsics)
            if np.count_nonzero(depth) < MIN_READINGS:
                problem = f"{np.count_nonzero(depth)} usable depth readings; at least {MIN_READINGS} are needed"
                raise ScanError(problem, where=str(path))
            color = read_image(frames.color_paths[index]) if frames.color_paths else None
            self.ready.append(prepare_frame(color, depth, frames.intrinsics))
            self.features.append(find_features(color, depth, frames.intrinsics))

    def track(self, source: int, target: int, steady: FloatArray) -> Edge:
        """Track one frame to another: from matched features, or where these are too few from a steady motion.

        Raises:
            ScanError: too little of the two frames fits together.
        """
        camera = self.frames.intrinsics
        where = f"{self.frames.depth_paths[source].name} to {self.frames.depth_paths[target].name}"
        hint = "move more slowly, keep the object filling the frame, and use textured fabric"
        guess = guess_motion(self.features[source], self.features[target], camera)
        try:
            found = align_frames(
                self.ready[source], self.ready[target], camera, steady if guess is None else guess, self.max_jump
            )
        except ScanError as e:
            raise ScanError(e.problem, where=where, hint=hint) from None
        if found.overlap < self.min_overlap:
            wanted = f"{100 * self.min_overlap:.0f} % needed"
            problem = f"lost track: {100 * found.overlap:.0f} % of the readings fit; {wanted}"
            raise ScanError(problem, where=where, hint=hint)
        return Edge(source, target, found.target_from_source, found.information, guess is not None)

    def try_track(self, source: int, target: int, steady: FloatArray) -> Edge | None:
        """As `track`, for an edge that may not exist: shape alone would confirm any turn of a round garment."""
        try:
            edge = self.track(source, target, steady)
        except ScanError:
            return None
        return edge if edge.confirmed or not self.frames.color_paths else None

    def sample_points(self, poses: FloatArray) -> FloatArray:
        """A few points of every frame in the world, shape (P, 3)."""
        points = []
        for frame, pose in zip(self.ready, poses, strict=True):
            part = frame.points[::8, ::8]
            local = part[part[..., 2] > 0]
            points.append(local @ pose[:3, :3].T + pose[:3, 3])
        return np.concatenate(points)
