"""Frame-to-frame tracking beside Open3D's, on depth frames whose cameras are known."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.io.captures.depth import read_depth, read_depth_frames
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.scan.depth.depth_mask import clean_depth
from vto_pipeline.scan.depth.pose_guess import guess_motion
from vto_pipeline.scan.depth.rgbd_alignment import align_frames
from vto_pipeline.scan.depth.tracker import Tracker

SAMPLES = Path(__file__).parents[2] / "sample_data"
PAIRS = 30
JUMP_M, FAR_M = 0.03, 3.0


def hybrid(frames: DepthFrameSet, starts: list[FloatArray]) -> list[FloatArray]:
    """Motions by Open3D's joint shape and colour objective, from the same starts on the same cleaned depth."""
    import open3d as o3d

    odometry, tensor, image = o3d.t.pipelines.odometry, o3d.core.Tensor, o3d.t.geometry.Image
    pictures = []
    for color, depth in zip(frames.color_paths[: PAIRS + 1], frames.depth_paths[: PAIRS + 1], strict=True):
        clean = clean_depth(read_depth(depth, frames.depth_scale), frames.intrinsics)
        pictures.append(o3d.t.geometry.RGBDImage(image(tensor(read_image(color))), image(tensor(clean))))
    steps = [odometry.OdometryConvergenceCriteria(count) for count in (6, 3, 1)]  # Open3D's own
    return [
        odometry.rgbd_odometry_multi_scale(
            pictures[i],
            pictures[i + 1],
            tensor(frames.intrinsics.matrix),
            tensor(start),
            1.0,
            FAR_M,
            steps,
            odometry.Method.Hybrid,
        ).transformation.numpy()
        for i, start in enumerate(starts)
    ]


@pytest.mark.slow
def test_our_alignment_is_nearer_the_truth_than_that_of_open3d(capsys: pytest.CaptureFixture[str]) -> None:
    """It stays for that: half the error."""
    frames = read_depth_frames(SAMPLES / "shirt_on_form" / "depth")
    cameras = np.array(json.loads((SAMPLES / "truth" / "depth_trajectory.json").read_text())["world_from_cam"])
    tracker = Tracker(frames, min_overlap=0.3, max_jump=JUMP_M)
    camera = frames.intrinsics
    ready = [tracker.prepare(i) for i in range(PAIRS + 1)]
    guesses = [guess_motion(ready[i].features, ready[i + 1].features, camera) for i in range(PAIRS)]
    starts = [np.eye(4) if guess is None else guess for guess in guesses]
    begin = time.perf_counter()
    ours = [
        align_frames(ready[i].surface, ready[i + 1].surface, start, JUMP_M).target_from_source
        for i, start in enumerate(starts)
    ]
    between = time.perf_counter()
    theirs = hybrid(frames, starts)
    seconds = {"ours": between - begin, "Hybrid": time.perf_counter() - between}
    errors = {}
    for name, found in (("ours", ours), ("Hybrid", theirs)):
        true = [np.linalg.inv(cameras[i + 1]) @ cameras[i] for i in range(PAIRS)]
        shift = [np.linalg.norm((np.linalg.inv(t) @ f)[:3, 3]) for t, f in zip(true, found, strict=True)]
        errors[name] = 1e3 * np.percentile(shift, [50, 95])
        with capsys.disabled():
            median, p95 = errors[name]
            print(f"\n{name}: {median:.3f} mm, p95 {p95:.3f} mm, {1e3 * seconds[name] / PAIRS:.0f} ms a pair")  # noqa: T201
    assert 0.05 < errors["ours"][0] < 0.3  # mm
    assert (errors["ours"] < 0.75 * errors["Hybrid"]).all()
