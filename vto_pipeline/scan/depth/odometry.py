"""The path of a depth camera: frame-to-frame tracking, loops closed by a pose graph."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations

import numpy as np
from pydantic import Field

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.depth.pose_graph import Edge, disagreement, optimise_poses
from vto_pipeline.scan.depth.tracker import Tracker
from vto_pipeline.scan.upright import upright_from_scan


class OdometryConfig(Config):
    """Settings of the tracking."""

    skip: int = Field(3, ge=2, le=30, description="Each frame is also tracked to the one this many later")
    loop_angle_deg: float = Field(16.0, gt=0, le=90, description="Largest angle between frames that close a loop")
    loop_gap: int = Field(10, ge=3, le=10_000, description="Least number of frames between the ends of a loop")
    max_loops: int = Field(60, ge=0, le=10_000, description="Loop edges tried, the most similar first")
    min_overlap: float = Field(0.3, gt=0, le=1, description="Share of a frame's readings that must fit the other's")
    max_jump_mm: float = Field(30.0, gt=1, le=500, description="Readings further apart than this do not match [mm]")


def estimate_trajectory(frames: DepthFrameSet, config: OdometryConfig, job: Job) -> FloatArray:
    """Estimate the camera pose of each frame.

    Frames are tracked one to the next, to one a few later, and where the path comes back; a robust pose graph (Choi et
    al. 2015, in Open3D) weighs all of it.

    Args:
        frames: Depth and registered colour, in the order they were taken.
        config: Settings.
        job: Receives progress, frame by frame.

    Returns:
        world_from_cam [m], shape (N, 4, 4), roughly upright, the first camera in front; given poses as they are.

    Raises:
        ScanError: a frame holds no readings, or tracking was lost.
    """
    if frames.world_from_cam is not None:
        job.leave_out("odometry", "the frames come with poses")
        return frames.world_from_cam
    if not frames.color_paths:
        job.warn("no colour frames: tracking by shape alone drifts on round garments")
    tracker = Tracker(frames, config.min_overlap, config.max_jump_mm / 1000)
    count = len(frames.depth_paths)
    poses = np.tile(np.eye(4), (count, 1, 1))
    edges: list[Edge] = []
    for i in range(count - 1):
        steady = np.eye(4) if i == 0 else np.linalg.inv(poses[i]) @ poses[i - 1]
        edge = tracker.track(i, i + 1, steady)
        edges.append(edge)
        poses[i + 1] = poses[i] @ np.linalg.inv(edge.target_from_source)
        job.progress(0.5 * (i + 1) / count, f"tracking frame {i + 2} of {count}")
    skips = [(i, i + config.skip) for i in range(count - config.skip)]
    wanted = skips + _loops(poses, config)
    loops = 0
    starts = [np.linalg.inv(poses[j]) @ poses[i] for i, j in wanted]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(tracker.try_track, *zip(*wanted, strict=True), starts) if wanted else iter(())
        for done, extra in enumerate(found):
            if extra is not None:
                edges.append(extra)
                loops += extra.target - extra.source > config.skip
            job.progress(0.5 + 0.4 * (done + 1) / len(wanted), f"checking pair {done + 1} of {len(wanted)}")
    poses = optimise_poses(poses, edges, config.max_jump_mm / 3000)
    residual = np.array([disagreement(poses, edge) for edge in edges])
    job.measure(
        frames=count,
        edges=len(edges),
        loop_edges=loops,
        edge_residual_median_mm=round(1000 * float(np.median(residual)), 3),
        edge_residual_max_mm=round(1000 * float(residual.max()), 3),
    )
    slid = sum(not edge.confirmed for edge in edges[: count - 1])
    if slid and frames.color_paths:
        job.warn(f"{slid} of {count - 1} steps have too few matched features: there, the path relies on shape alone")
    if loops == 0:
        job.warn("the path closes no loop: expect centimetres of drift; end the capture where it began")
    return upright_from_scan(poses, tracker.sample_points(poses)) @ poses


def _loops(poses: FloatArray, config: OdometryConfig) -> list[tuple[int, int]]:
    """Return pairs far apart in time with similar views, the most similar first."""
    forward = poses[:, :3, 2]
    cosine = forward @ forward.T
    limit = np.cos(np.radians(config.loop_angle_deg))
    pairs = [(i, j) for i, j in combinations(range(len(poses)), 2) if j - i >= config.loop_gap and cosine[i, j] > limit]
    return sorted(sorted(pairs, key=lambda pair: -cosine[pair])[: config.max_loops])
