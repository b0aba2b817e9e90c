"""From raw captures to a surface in metres: the same rows for garment, mannequin and body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from vto_pipeline.model.job import Job
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.scan.depth.odometry import OdometryConfig, estimate_trajectory
from vto_pipeline.scan.fuse import FuseConfig, PhotoFuseConfig, check_coverage, fuse_depth_frames, fuse_depth_maps
from vto_pipeline.scan.keyframes import KeyframesConfig, take_keyframes
from vto_pipeline.scan.photos.scale import ScaleConfig, apply_scale
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.photos.stereo import StereoConfig, estimate_depth_maps
from vto_pipeline.scan.surface import SurfaceConfig, reconstruct_cloud
from vto_pipeline.stages.roles import for_each_role

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]


def _keyframes(inputs: Inputs, settings: KeyframesConfig, job: Job) -> Outputs:
    return {"photos": take_keyframes(inputs["video"], settings, job)}


def _sfm(inputs: Inputs, settings: SfmConfig, job: Job) -> Outputs:
    return {"sparse": estimate_cameras(inputs["photos"], settings, job)}


def _scale(inputs: Inputs, settings: ScaleConfig, job: Job) -> Outputs:
    cameras, points = inputs["sparse"]
    cameras, points = apply_scale(inputs["photos"], cameras, points, settings, job)
    return {"cameras": cameras, "points": points}


def _stereo(inputs: Inputs, settings: StereoConfig, job: Job) -> Outputs:
    return {"depth_maps": estimate_depth_maps(inputs["photos"], inputs["cameras"], inputs["points"], settings, job)}


def _fuse_photos(inputs: Inputs, settings: PhotoFuseConfig, job: Job) -> Outputs:
    photos, cameras, points, maps = (inputs[name] for name in ("photos", "cameras", "points", "depth_maps"))
    surface = replace(fuse_depth_maps(photos, cameras, maps, settings, job), metric=cameras.metric)
    check_coverage(surface, maps, points, settings, job)
    return {"surface": surface}


def _odometry(inputs: Inputs, settings: OdometryConfig, job: Job) -> Outputs:
    return {"trajectory": estimate_trajectory(inputs["depth"], settings, job)}


def _fuse_depth(inputs: Inputs, settings: FuseConfig, job: Job) -> Outputs:
    return {"surface": fuse_depth_frames(inputs["depth"], inputs["trajectory"], settings, job)}


def _poisson(inputs: Inputs, settings: SurfaceConfig, job: Job) -> Outputs:
    return {"surface": reconstruct_cloud(inputs["cloud"], settings, job)}


STAGES: tuple[Stage, ...] = (
    *for_each_role(
        "keyframes",
        "the sharpest frames of a video, evenly along its way",
        needs=("video",),
        makes=("photos",),
        run=_keyframes,
        settings=KeyframesConfig,
        uses=("opencv-python-headless",),
    ),
    *for_each_role(
        "sfm",
        "camera poses of the photos, up to scale (structure from motion)",
        needs=("photos",),
        makes=("sparse",),
        run=_sfm,
        settings=SfmConfig,
        uses=("pycolmap", "opencv-python-headless"),
    ),
    *for_each_role(
        "scale",
        "scale and floor, from the printed board, or scale from a stated length or stature",
        needs=("photos", "sparse"),
        makes=("cameras", "points"),
        run=_scale,
        settings=ScaleConfig,
        uses=("opencv-python-headless",),
    ),
    *for_each_role(
        "stereo",
        "a depth map for each photo, checked against its neighbours",
        needs=("photos", "cameras", "points"),
        makes=("depth_maps",),
        run=_stereo,
        settings=StereoConfig,
        uses=("opencv-python-headless",),
        fits_memory=True,
    ),
    *for_each_role(
        "fuse_photos",
        "one surface from the depth maps",
        needs=("photos", "cameras", "points", "depth_maps"),
        makes=("surface",),
        run=_fuse_photos,
        settings=PhotoFuseConfig,
        uses=("open3d",),
        fits_memory=True,
    ),
    *for_each_role(
        "odometry",
        "camera poses of the depth frames",
        needs=("depth",),
        makes=("trajectory",),
        run=_odometry,
        settings=OdometryConfig,
        uses=("open3d", "opencv-python-headless"),
    ),
    *for_each_role(
        "fuse_depth",
        "one surface from the depth frames",
        needs=("depth", "trajectory"),
        makes=("surface",),
        run=_fuse_depth,
        settings=FuseConfig,
        uses=("open3d", "opencv-python-headless"),
        fits_memory=True,
    ),
    *for_each_role(
        "poisson",
        "a surface through the point cloud, trimmed where there are no points",
        needs=("cloud",),
        makes=("surface",),
        run=_poisson,
        settings=SurfaceConfig,
        uses=("open3d",),
    ),
)
