"""Photos of a painted tube by closed form: where a ray meets it is known, and what colour is there."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scan_scene import look_at

from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, HEIGHT = 0.15, 0.4
SKIN = np.array([225.0, 200.0, 30.0])
BACKDROP, POST = np.array([250.0, 250.0, 0.0]), np.array([255.0, 0.0, 255.0])
CAMERA = Intrinsics(320, 240, 400.0, 400.0, 159.5, 119.5, 0.02)
POST_RADIUS, POST_PLACE = 0.02, np.array([0.05, 0.30])  # of an upright post, in x and z


def paint(points: np.ndarray, skin: float = 0.0) -> np.ndarray:
    """Colour of the tube, 0 to 255, shape (..., 3): waves of 20 mm and more, in each channel other ones.

    So much [m] of its upper end is bare form.
    """
    angle, y = np.arctan2(points[..., 0], points[..., 2]), points[..., 1]
    waves = [
        np.sin(2 * np.pi * y / 0.030) * np.cos(9 * angle),
        np.sin(2 * np.pi * y / 0.055 + 3 * angle),
        np.cos(2 * np.pi * y / 0.020),
    ]
    cloth = 120 + np.stack([40 * wave for wave in waves], axis=-1)
    return np.where((y > HEIGHT - skin)[..., None], SKIN, cloth) if skin else cloth


def tube(around: int = 96, up: int = 24) -> TriangleMesh:
    """The tube in triangles, open at both ends, its outside counter-clockwise."""
    return _pipe(RADIUS, np.zeros(2), around, up)


def post() -> TriangleMesh:
    """What stands before the tube."""
    return _pipe(POST_RADIUS, POST_PLACE, 24, 4)


def cameras(count: int, arc_deg: float) -> CameraSet:
    """Cameras on an arc before the tube, in two heights."""
    poses = []
    for k, turn in enumerate(np.radians(np.linspace(-0.5 * arc_deg, 0.5 * arc_deg, count))):
        eye = np.array([0.8 * np.sin(turn), 0.2 + (0.25 if k % 2 else 0.0), 0.8 * np.cos(turn)])
        poses.append(look_at(eye, np.array([0.0, 0.2, 0.0])))
    return CameraSet(tuple(f"{k:02d}.png" for k in range(count)), (CAMERA,) * count, np.array(poses))


def photograph(
    folder: Path, taken: CameraSet, *, gains: np.ndarray | None = None, with_post: bool = False, skin: float = 0.0
) -> PhotoSet:
    """Take the photos, four rays to a pixel; `gains` (C, 3) are the exposure and white balance of each."""
    paths = []
    for index, (name, camera, pose) in enumerate(zip(taken.names, taken.intrinsics, taken.world_from_cam, strict=True)):
        color = np.mean(
            [_rays(camera, pose, dx, dy, with_post, skin) for dx in (-0.25, 0.25) for dy in (-0.25, 0.25)], axis=0
        )
        color = color if gains is None else color * gains[index]
        paths.append(folder / name)
        cv2.imwrite(str(paths[-1]), np.clip(np.rint(color), 0, 255).astype(np.uint8)[..., ::-1])
    return PhotoSet(tuple(paths), taken.intrinsics)


def _rays(camera: Intrinsics, pose: np.ndarray, dx: float, dy: float, with_post: bool, skin: float) -> np.ndarray:
    u, v = np.meshgrid(np.arange(camera.width) + dx, np.arange(camera.height) + dy)
    bent = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy], axis=-1)
    flat = bent.copy()
    for _ in range(20):  # x (1 + k1 r²) = bent
        flat = bent / (1.0 + camera.k1 * (flat**2).sum(axis=-1, keepdims=True))
    ray = np.concatenate([flat, np.ones((*flat.shape[:2], 1))], axis=-1) @ pose[:3, :3].T
    eye = pose[:3, 3]
    near, _ = _hits(eye, ray, RADIUS, np.zeros(2))
    color = np.where(
        np.isfinite(near)[..., None], paint(eye + np.nan_to_num(near, posinf=0.0)[..., None] * ray, skin), BACKDROP
    )
    _, inner = _hits(eye, ray, RADIUS, np.zeros(2))
    lining = np.isinf(near) & np.isfinite(inner)
    color[lining] = BACKDROP
    if with_post:
        color[_hits(eye, ray, POST_RADIUS, POST_PLACE)[0] < near] = POST
    return color


def _hits(eye: np.ndarray, ray: np.ndarray, radius: float, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays enter and leave an upright cylinder within its height, infinite where they do not, each (H, W)."""
    o, d = eye[[0, 2]] - place, ray[..., [0, 2]]
    a, b, c = (d**2).sum(axis=-1), (d * o).sum(axis=-1), (o**2).sum() - radius**2
    root = b**2 - a * c
    found = []
    for sign in (-1.0, 1.0):
        t = (-b + sign * np.sqrt(np.maximum(root, 0.0))) / a
        y = eye[1] + t * ray[..., 1]
        found.append(np.where((root > 0) & (t > 0) & (y > 0) & (y < HEIGHT), t, np.inf))
    return found[0], found[1]


def _pipe(radius: float, place: np.ndarray, around: int, up: int) -> TriangleMesh:
    angle, height = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, HEIGHT, up + 1), indexing="ij")
    points = np.stack([place[0] + radius * np.sin(angle), height, place[1] + radius * np.cos(angle)], axis=-1)
    i, j = np.meshgrid(np.arange(around), np.arange(up), indexing="ij")
    a, b = i * (up + 1) + j, (i + 1) % around * (up + 1) + j
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)]).reshape(-1, 3)
    return TriangleMesh(points.reshape(-1, 3), faces)
