"""Photos of the dressed form: two rings of cameras, sensor noise, JPEG with EXIF."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image

from vto_pipeline.bench.samples.captures.render import RenderScene, render
from vto_pipeline.bench.samples.captures.viewpoints import on_ring
from vto_pipeline.io.files import replacing
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet, Intrinsics

CAMERA = Intrinsics(800, 600, 880.0, 880.0, 399.5, 299.5)
FOCAL_MM, PIXELS_PER_CM = 22, 400  # 22 mm x 40 px/mm = 880 px: a sensor of 20 x 15 mm
PER_RING = 18
# Distance [m], elevation [deg], first azimuth [deg], height of the point looked at [m].
RINGS = ((1.36, -10.0, 4.0, 0.47), (1.56, 34.0, 14.0, 0.42))
NOISE = 2.0 / 255.0
QUALITY = 92
SEED = 41


def photo_cameras() -> CameraSet:
    """Where the photos are taken from, a little unevenly, as by hand."""
    rng = np.random.default_rng(SEED)
    poses = []
    for distance, elevation, first, height in RINGS:
        for azimuth in first + 360.0 / PER_RING * np.arange(PER_RING):
            target = np.array([0.0, height, 0.0]) + rng.normal(0.0, 0.008, 3)
            near = distance * (1.0 + rng.normal(0.0, 0.01))
            poses.append(on_ring(near, elevation + rng.normal(0.0, 0.7), azimuth + rng.normal(0.0, 1.0), target))
    names = tuple(f"IMG_{i + 1:04d}.jpg" for i in range(len(poses)))
    return CameraSet(names, (CAMERA,) * len(poses), np.array(poses))


def exposed(picture: FloatArray, seed: int, *, noise: float = NOISE) -> ByteArray:
    """Add sensor noise to an sRGB picture in 0..1 and round it to bytes, shape (H, W, 3)."""
    noisy = picture + np.random.default_rng(seed).normal(0.0, noise, picture.shape)
    return np.clip(np.rint(noisy * 255.0), 0, 255).astype(np.uint8)


def write_photo(path: Path, picture: ByteArray) -> None:
    """Write a JPEG whose EXIF says what the camera is; the focal length three ways, all of them the same."""
    image = Image.fromarray(picture)
    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = "vto_pipeline", "synthetic 20 x 15 mm"
    details = exif.get_ifd(0x8769)
    details[0x920A] = FOCAL_MM
    details[0xA20E] = details[0xA20F] = PIXELS_PER_CM
    details[0xA210] = 3  # per centimetre
    details[0xA002], details[0xA003] = image.width, image.height
    sensor_mm = 10.0 / PIXELS_PER_CM * math.hypot(image.width, image.height)
    details[0xA405] = round(FOCAL_MM * math.hypot(36.0, 24.0) / sensor_mm)
    with replacing(path) as beside:
        image.save(beside, quality=QUALITY, exif=exif)


def write_photos(folder: Path, scene: RenderScene) -> CameraSet:
    """Take and write all photos; returns where they were taken from."""
    cameras = photo_cameras()
    for index, (name, pose) in enumerate(zip(cameras.names, cameras.world_from_cam, strict=True)):
        write_photo(folder / name, exposed(render(scene, CAMERA, pose), SEED + 1 + index))
    return cameras
