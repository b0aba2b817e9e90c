"""The path of a depth camera: frames tracked to keyframes, loops closed, all keyframes refined together."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.depth.bundle import choose_pairs, refine_together
from vto_pipeline.scan.depth.contradiction import compare_frames, contradicted_share
from vto_pipeline.scan.depth.pose_graph import Edge, disagreement, optimise_poses
from vto_pipeline.scan.depth.rgbd_frame import RgbdFrame
from vto_pipeline.scan.depth.tracker import MIN_READINGS, TrackedFrame, Tracker
from vto_pipeline.scan.photos.consistency import rays
from vto_pipeline.scan.upright import upright_from_scan

Place = tuple[int, FloatArray]
"""Of a frame: the keyframe that it follows, and its pose in that keyframe's camera."""

LOOKED_BACK = 10
"""Keyframes before the last to which a frame that lost track is held."""

MOST_LOST = 0.34
"""Share of the frames that may be left out."""

MOST_AGAINST = 0.15
"""A keyframe of whose points a larger share floats before what others see was placed wrongly: of six such, half or more
did, of 46 others none."""


class OdometryConfig(Config):
    """Settings of the tracking."""

    keyframe_deg: float = Field(5.0, ge=0, le=45, description="A frame turned further than this is a keyframe")
    keyframe_overlap: float = Field(0.7, ge=0, le=1, description="So is one that shares less with the last")
    loop_angle_deg: float = Field(16.0, gt=0, le=90, description="Largest angle between keyframes that close a loop")
    loop_gap: int = Field(10, ge=3, le=10_000, description="Least number of keyframes between the ends of a loop")
    max_loops: int = Field(60, ge=0, le=10_000, description="Loop edges tried, the most similar first")
    pair_deg: float = Field(45.0, gt=0, le=90, description="Keyframes at up to this angle are refined together")
    min_overlap: float = Field(0.3, gt=0, le=1, description="Share of a frame's points that must fit the other's")
    max_jump_mm: float = Field(30.0, gt=1, le=500, description="Points further apart than this do not match [mm]")


def estimate_trajectory(frames: DepthFrameSet, config: OdometryConfig, job: Job) -> FloatArray:
    """Estimate the camera pose of each frame.

    Each frame is tracked to the last keyframe, and becomes one when it has moved on. Where the path comes back,
    keyframes far apart in time are tracked to each other, and a robust pose graph (Choi et al. 2015, in Open3D) closes
    the loop; then all pairs of keyframes that see the same surface are aligned together. Those that the others
    contradict are left out. The other frames follow their keyframes. In memory are the keyframes, made smaller, and few
    frames more.

    Args:
        frames: Depth and registered colour, in the order they were taken.
        config: Settings.
        job: Receives progress, frame by frame.

    Returns:
        world_from_cam [m], shape (N, 4, 4), roughly upright, the first camera in front; NaN for frames that are left
        out. Given poses are returned as they are, approximate ones refined.

    Raises:
        ScanError: more than a third of the frames hold no readings, lost track, or are contradicted by others.
    """
    given = frames.world_from_cam
    if given is not None and not frames.poses_approximate:
        job.leave_out("odometry", "the frames come with poses")
        return given
    tracker = Tracker(frames, config.min_overlap, config.max_jump_mm / 1000)
    if given is None:
        surfaces, start, owner = _tracked_path(tracker, config, job)
    else:
        surfaces, start, owner = _given_path(tracker, given, config, job)
    widest = np.radians(config.pair_deg)
    bundle = refine_together(surfaces, start, widest, job)
    path = bundle.world_from_cam
    loops = _loops(path, config)
    compared = compare_frames(surfaces, path, [*choose_pairs(path, widest), *loops], config.max_jump_mm / 1000)
    wrong = contradicted_share(compared, len(surfaces)) > MOST_AGAINST
    owner = _without(owner, wrong, frames.depth_paths, job)
    agree = {(pair.one, pair.other) for pair in compared if pair.against <= MOST_AGAINST}
    if given is None and agree.isdisjoint(loops):
        job.warn("the path closes no loop: expect centimetres of drift; end the capture where it began")
    shift = np.linalg.norm(path[:, :3, 3] - start[:, :3, 3], axis=1)
    job.measure(
        frames=len(owner),
        keyframes=int(np.count_nonzero(~wrong)),
        pairs_refined=bundle.pairs,
        refined_by_mm=round(1000 * float(np.median(shift)), 3),
        last_step_mm=round(1000 * bundle.moved, 4),
    )
    known = [k for k, place in enumerate(owner) if place is not None]
    poses = np.full((len(owner), 4, 4), np.nan)
    poses[known] = [path[place[0]] @ place[1] for place in owner if place is not None]
    seen = _sample_points([one for one, bad in zip(surfaces, wrong, strict=True) if not bad], path[~wrong])
    poses[known] = upright_from_scan(poses[known], seen) @ poses[known]
    return poses


def _without(
    owner: list[Place | None], wrong: NDArray[np.bool_], paths: Sequence[Path], job: Job
) -> list[Place | None]:
    """Places of the frames without those that follow a keyframe that was placed wrongly, (K,).

    Raises:
        ScanError: too few are left.
    """
    left = [None if place is None or wrong[place[0]] else place for place in owner]
    out = [index for index, (was, now) in enumerate(zip(owner, left, strict=True)) if was is not None and now is None]
    if not out:
        return left
    count, first = f"{len(out)} of {len(owner)} frames", paths[out[0]].name
    if left.count(None) > MOST_LOST * len(left):
        hint = "move the camera more slowly, and keep the garment in the middle of the picture"
        problem = f"the path does not hold together: {count} show surfaces where others see through; the first: {first}"
        raise ScanError(problem, where=str(paths[0].parent), hint=hint)
    job.warn(f"left out {count} that were placed wrongly: others see through what they show; the first: {first}")
    return left


def _given_path(
    tracker: Tracker, poses: FloatArray, config: OdometryConfig, job: Job
) -> tuple[list[RgbdFrame], FloatArray, list[Place | None]]:
    """As `_tracked_path`, from given poses."""
    chosen = [0]
    limit = np.radians(config.keyframe_deg)  # at a metre, a shift by as many metres is the same to the eye
    for index, pose in enumerate(poses):
        relative = np.linalg.inv(poses[chosen[-1]]) @ pose
        turned = np.linalg.norm(Rotation.from_matrix(relative[:3, :3]).as_rotvec())
        if turned > limit or np.linalg.norm(relative[:3, 3]) > limit:
            chosen.append(index)
    keyframes = []
    for done, frame in enumerate(tracker.read(chosen)):
        if frame is not None:
            keyframes.append(frame)
        job.progress(0.7 * (done + 1) / len(chosen), f"read keyframe {done + 1} of {len(chosen)}")
    if not keyframes:
        tracker.prepare(chosen[0])  # says why
    at = [frame.index for frame in keyframes]
    last = np.maximum(np.searchsorted(at, np.arange(len(poses)), side="right") - 1, 0)
    owner: list[Place | None] = [(int(k), np.linalg.inv(poses[at[k]]) @ p) for k, p in zip(last, poses, strict=True)]
    return [frame.surface for frame in keyframes], poses[at], owner


def _tracked_path(
    tracker: Tracker, config: OdometryConfig, job: Job
) -> tuple[list[RgbdFrame], FloatArray, list[Place | None]]:
    """Keyframes, their poses, and the place of each frame; None where it is left out."""
    colors = tracker.frames.color_paths
    if not colors:
        job.warn("no colour frames: tracking by shape alone drifts on round garments")
    keyframes, edges, owner = _track(tracker, config, job)
    path = _chained(keyframes, edges)
    loop_edges = _close_loops(tracker, keyframes, path, config, job)
    place = {key.index: k for k, key in enumerate(keyframes)}
    between = [edge for edge in edges if edge.source in place] + loop_edges
    local = [replace(edge, source=place[edge.source], target=place[edge.target]) for edge in between]
    if loop_edges:
        path = optimise_poses(path, local, config.max_jump_mm / 3000)
    residual = np.array([disagreement(path, edge) for edge in local] or [0.0])
    job.measure(
        loop_edges=len(loop_edges),
        edge_residual_median_mm=round(1000 * float(np.median(residual)), 3),
        edge_residual_max_mm=round(1000 * float(residual.max()), 3),
    )
    slid = sum(not edge.confirmed for edge in edges)
    if slid and colors:
        job.warn(f"{slid} of {len(edges)} steps have too few matched features: there, the path relies on shape alone")
    return [key.surface for key in keyframes], path, owner


def _track(
    tracker: Tracker, config: OdometryConfig, job: Job
) -> tuple[list[TrackedFrame], list[Edge], list[Place | None]]:
    """Keyframes; an edge from each frame but the first to a keyframe before it; the place of each frame.

    A frame that fits neither the last keyframe nor one before it is left out.
    """
    keyframes: list[TrackedFrame] = []
    edges: list[Edge] = []
    owner: list[Place | None] = []
    lost: list[ScanError] = []
    before, step = np.eye(4), np.eye(4)  # the last frame in the last keyframe's camera; its motion in its own
    paths = tracker.frames.depth_paths
    for index, frame in enumerate(tracker.read(range(len(paths)))):
        job.progress(0.6 * (index + 1) / len(paths), f"tracked frame {index + 1} of {len(paths)}")
        if frame is None:
            owner.append(None)
            lost.append(ScanError(f"fewer than {MIN_READINGS} usable depth readings", where=str(paths[index])))
            continue
        if not keyframes:
            keyframes.append(frame)
            owner.append((0, np.eye(4)))
            continue
        edge = _edge_to_keyframe(tracker, frame, keyframes, before @ step, lost)
        if edge is None:
            owner.append(None)
            continue
        edges.append(edge)
        pose = edge.target_from_source
        turned = np.degrees(np.linalg.norm(Rotation.from_matrix(pose[:3, :3]).as_rotvec()))
        found_again = edge.target != keyframes[-1].index
        step = np.eye(4) if found_again else np.linalg.inv(before) @ pose
        if turned > config.keyframe_deg or edge.overlap < config.keyframe_overlap or found_again:
            keyframes.append(frame)
            pose = np.eye(4)
        owner.append((len(keyframes) - 1, pose))
        before = pose
    if len(lost) > MOST_LOST * len(paths):
        raise lost[0]
    if lost:
        job.warn(f"left out {len(lost)} of {len(paths)} frames; the first: {lost[0].where}: {lost[0].problem}")
    return keyframes, edges, owner


def _edge_to_keyframe(
    tracker: Tracker, frame: TrackedFrame, keyframes: list[TrackedFrame], steady: FloatArray, lost: list[ScanError]
) -> Edge | None:
    """An edge to the last keyframe, or to an earlier one whose features match; what was wrong with the last is kept."""
    try:
        return tracker.track(frame, keyframes[-1], steady)
    except ScanError as error:
        if tracker.frames.color_paths:
            for key in keyframes[-2 : -2 - LOOKED_BACK : -1]:
                edge = tracker.try_track(frame, key, np.eye(4))
                if edge is not None:
                    return edge
        lost.append(error)
        return None


def _chained(keyframes: list[TrackedFrame], edges: list[Edge]) -> FloatArray:
    """Poses of the keyframes along the path, shape (K, 4, 4)."""
    edge_from = {edge.source: edge for edge in edges}
    pose_of = {keyframes[0].index: np.eye(4)}
    for key in keyframes[1:]:
        edge = edge_from[key.index]
        pose_of[key.index] = pose_of[edge.target] @ edge.target_from_source
    return np.stack([pose_of[key.index] for key in keyframes])


def _close_loops(
    tracker: Tracker, keyframes: list[TrackedFrame], path: FloatArray, config: OdometryConfig, job: Job
) -> list[Edge]:
    """Edges between keyframes far apart in time with similar views."""
    wanted = _loops(path, config)
    starts = [np.linalg.inv(path[j]) @ path[i] for i, j in wanted]
    found = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        ends = [[keyframes[pair[side]] for pair in wanted] for side in (0, 1)]
        for done, edge in enumerate(pool.map(tracker.try_track, *ends, starts)):
            if edge is not None:
                found.append(edge)
            job.progress(0.6 + 0.1 * (done + 1) / len(wanted), f"checking pair {done + 1} of {len(wanted)}")
    return found


def _loops(poses: FloatArray, config: OdometryConfig) -> list[tuple[int, int]]:
    """Return pairs far apart in time with similar views, the most similar first."""
    forward = poses[:, :3, 2]
    cosine = forward @ forward.T
    limit = np.cos(np.radians(config.loop_angle_deg))
    pairs = [(i, j) for i, j in combinations(range(len(poses)), 2) if j - i >= config.loop_gap and cosine[i, j] > limit]
    return sorted(sorted(pairs, key=lambda pair: -cosine[pair])[: config.max_loops])


def _sample_points(surfaces: list[RgbdFrame], poses: FloatArray) -> FloatArray:
    """A few points of every keyframe in the world, shape (P, 3)."""
    points = []
    for frame, pose in zip(surfaces, poses, strict=True):
        part = (rays(frame.camera.matrix, *frame.depth.shape) * frame.depth[..., None])[::4, ::4]
        points.append(part[part[..., 2] > 0] @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(points)
