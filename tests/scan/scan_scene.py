"""A small scene with known truth: an open, folded, printed tube over a ChArUco board, rendered with Open3D."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import CharucoBoard, DepthFrameSet, PhotoSet

BOARD = CharucoBoard(columns=9, rows=7, square_m=0.04, marker_m=0.03)


@dataclass(frozen=True)
class Scene:
    """Truth: the tube (vertices, faces, texture coordinates) and what it is painted with."""

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    texture: np.ndarray
    floor: np.ndarray


def make_scene(*, contrast: float = 1.0, seed: int = 5) -> Scene:
    """Build a tube 0.36 m tall, 0.15 m wide, with folds of 8 mm, floating 0.12 m over the board."""
    around, up = 240, 120
    angle, height = np.meshgrid(np.linspace(0, 2 * np.pi, around + 1), np.linspace(0, 1, up + 1), indexing="ij")
    radius = 0.15 + 0.03 * np.sin(2.5 * height) + 0.008 * np.sin(7 * angle + 3 * height) * (1.2 - height)
    x, z = radius * np.cos(angle), 0.75 * radius * np.sin(angle)
    vertices = np.stack([x, 0.12 + 0.36 * height, z], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(up), indexing="ij")
    a, b = i * (up + 1) + j, (i + 1) * (up + 1) + j
    faces = np.concatenate([np.stack([a, a + 1, b], -1), np.stack([b, a + 1, b + 1], -1)]).reshape(-1, 3)
    uv = np.stack([angle / (2 * np.pi), height], axis=-1).reshape(-1, 2)
    random = np.random.default_rng(seed)
    texture = np.zeros((1024, 2048, 3), np.float32)
    for sigma in (1.5, 4, 12, 40):
        noise = cv2.GaussianBlur(random.normal(size=texture.shape).astype(np.float32), (0, 0), sigma)
        texture += noise / noise.std()
    texture = np.clip(140 + 38 * contrast * texture / 2, 5, 250)
    size = (BOARD.columns * 40, BOARD.rows * 40)
    floor = charuco().generateImage(size, marginSize=0)
    return Scene(vertices, faces.astype(np.int32), uv, texture, floor)


def charuco() -> cv2.aruco.CharucoBoard:
    """The board as OpenCV draws and detects it."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, BOARD.dictionary))
    return cv2.aruco.CharucoBoard((BOARD.columns, BOARD.rows), BOARD.square_m, BOARD.marker_m, dictionary)


def orbit(count: int, *, distance: float = 1.0, elevations_deg: tuple[float, ...] = (12.0, 32.0)) -> np.ndarray:
    """Poses on rings around the tube, looking at it, shape (count, 4, 4)."""
    poses = []
    per_ring = count // len(elevations_deg)
    for ring, elevation in enumerate(np.radians(elevations_deg)):
        for k in range(per_ring):
            turn = 2 * np.pi * (k + 0.5 * ring) / per_ring
            offset = np.array([np.cos(elevation) * np.sin(turn), np.sin(elevation), np.cos(elevation) * np.cos(turn)])
            target = np.array([0, 0.24, 0])
            poses.append(look_at(target + distance * offset, target))
    return np.array(poses)


def look_at(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """World-from-camera transform of a camera that looks at a point, +Y of the world up in the picture."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return pose


def render(scene: Scene, camera: Intrinsics, pose: np.ndarray, *, samples: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Colour (H, W, 3) uint8 RGB and depth (H, W) float32 [m] of one view."""
    world = o3d.t.geometry.RaycastingScene()
    world.add_triangles(scene.vertices.astype(np.float32), scene.faces.astype(np.uint32))
    quad = np.array([[-3, 0, -3], [3, 0, -3], [3, 0, 3], [-3, 0, 3]], np.float32)
    world.add_triangles(quad, np.array([[0, 2, 1], [0, 3, 2]], np.uint32))
    color = _shade(scene, world, camera, pose, samples)
    _, hit = _cast(world, camera, pose, 1)
    depth = hit["t_hit"].numpy()
    return color, np.where(np.isfinite(depth), depth, 0).astype(np.float32)


def _cast(world: o3d.t.geometry.RaycastingScene, camera: Intrinsics, pose: np.ndarray, samples: int) -> tuple:
    u = (np.arange(camera.width * samples) + 0.5) / samples - 0.5
    v = (np.arange(camera.height * samples) + 0.5) / samples - 0.5
    x, y = np.meshgrid((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)
    direction = np.stack([x, y, np.ones_like(x)], -1) @ pose[:3, :3].T
    rays = np.concatenate([np.broadcast_to(pose[:3, 3], direction.shape), direction], -1).astype(np.float32)
    return rays, world.cast_rays(o3d.core.Tensor(rays))


def _shade(scene: Scene, world: o3d.t.geometry.RaycastingScene, camera: Intrinsics, pose, samples: int) -> np.ndarray:
    rays, hit = _cast(world, camera, pose, samples)
    t, geometry = hit["t_hit"].numpy(), hit["geometry_ids"].numpy()
    point = rays[..., :3] + np.where(np.isfinite(t), t, 0)[..., None] * rays[..., 3:]
    normal = hit["primitive_normals"].numpy()
    light = np.array([0.4, 0.8, 0.45]) / np.linalg.norm([0.4, 0.8, 0.45])
    shade = 0.65 + 0.35 * np.abs(normal @ light)
    image = np.full((*t.shape, 3), 120, np.float32)
    tube, floor = geometry == 0, geometry == 1
    corner = scene.faces[hit["primitive_ids"].numpy()[tube]]
    weight = hit["primitive_uvs"].numpy()[tube]
    weight = np.concatenate([1 - weight.sum(-1, keepdims=True), weight], -1)
    uv = (scene.uv[corner] * weight[..., None]).sum(1)
    image[tube] = _sample(scene.texture, uv * (np.array(scene.texture.shape[1::-1]) - 1)) * shade[tube, None]
    size = np.array([BOARD.columns, BOARD.rows]) * BOARD.square_m
    board = (point[floor][:, [0, 2]] / size + 0.5) * np.array(scene.floor.shape[1::-1]) - 0.5
    inside = ((board >= -0.5) & (board <= np.array(scene.floor.shape[1::-1]) - 0.5)).all(-1)
    ground = np.full((len(board), 3), 150, np.float32)
    ground[inside] = _sample(np.repeat(scene.floor[..., None], 3, -1).astype(np.float32), board[inside])
    image[floor] = ground
    shape = (camera.height, samples, camera.width, samples, 3)
    return np.clip(image.reshape(shape).mean((1, 3)) + 0.5, 0, 255).astype(np.uint8)


def _sample(picture: np.ndarray, position: np.ndarray) -> np.ndarray:
    limit = np.array(picture.shape[1::-1]) - 1
    position = np.clip(position, 0, limit)
    low = np.minimum(position.astype(int), limit - 1)
    f = (position - low)[..., None]
    x, y = low.T
    top = picture[y, x] * (1 - f[:, 0]) + picture[y, x + 1] * f[:, 0]
    bottom = picture[y + 1, x] * (1 - f[:, 0]) + picture[y + 1, x + 1] * f[:, 0]
    return top * (1 - f[:, 1]) + bottom * f[:, 1]


def photos(scene: Scene, folder: Path, poses: np.ndarray, camera: Intrinsics, *, board: bool = True) -> PhotoSet:
    """Render photos with sensor noise into a folder."""
    random = np.random.default_rng(1)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, pose in enumerate(poses):
        color, _ = render(scene, camera, pose)
        noisy = np.clip(color + random.normal(0, 1.5, color.shape), 0, 255).astype(np.uint8)
        paths.append(folder / f"{k:03d}.jpg")
        cv2.imwrite(str(paths[-1]), noisy[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 94])
    return PhotoSet(tuple(paths), (camera,) * len(paths), BOARD if board else None)


def depth_frames(scene: Scene, folder: Path, poses: np.ndarray, camera: Intrinsics, *, noise: float) -> DepthFrameSet:
    """Render depth frames [mm, 16 bit] with range noise [m] and registered colour into a folder."""
    random = np.random.default_rng(2)
    folder.mkdir(parents=True, exist_ok=True)
    depth_paths, color_paths = [], []
    for k, pose in enumerate(poses):
        color, depth = render(scene, camera, pose)
        reading = np.where(depth > 0, depth + random.normal(0, noise, depth.shape), 0)
        depth_paths.append(folder / f"{k:06d}.png")
        color_paths.append(folder / f"{k:06d}.jpg")
        cv2.imwrite(str(depth_paths[-1]), np.clip(np.round(1000 * reading), 0, 65535).astype(np.uint16))
        cv2.imwrite(str(color_paths[-1]), color[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 94])
    return DepthFrameSet(tuple(depth_paths), tuple(color_paths), camera, 1000.0)


def distances(scene: Scene, points: np.ndarray) -> np.ndarray:
    """Distance of points to the tube [m]."""
    world = o3d.t.geometry.RaycastingScene()
    world.add_triangles(scene.vertices.astype(np.float32), scene.faces.astype(np.uint32))
    return world.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
