"""A small renderer: exact visibility from Open3D's ray caster, soft light baked on vertices, procedural paint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from vto_pipeline.bench.samples.captures import textures
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.srgb import srgb_curve

CLOTH, LINEN, SUIT, PICTURE, FLOOR = range(5)
LAMPS = 192
BACKDROP = np.array([0.30, 0.31, 0.33])  # linear RGB


@dataclass(frozen=True)
class Surface:
    """A mesh and its paint.

    Args:
        mesh: Geometry [m].
        paint: CLOTH, LINEN, SUIT, PICTURE or FLOOR.
        coordinates: Cloth or picture coordinates of each triangle corner [m], shape (F, 3, 2); None when the paint is
            a solid.
    """

    mesh: TriangleMesh
    paint: int
    coordinates: FloatArray | None = None


@dataclass(frozen=True)
class RenderScene:
    """Surfaces made ready for rays. Built by `build_scene`."""

    rays: Any
    paints: IntArray
    face_start: IntArray
    faces: IntArray
    vertices: FloatArray
    coordinates: FloatArray
    light: FloatArray
    picture: FloatArray
    picture_scale: float


def build_scene(surfaces: list[Surface], picture: ByteArray | None = None, picture_scale: float = 1.0) -> RenderScene:
    """Collect surfaces and bake their light.

    Args:
        surfaces: What is in the scene.
        picture: Grey picture for the PICTURE paint, shape (H, W), or None.
        picture_scale: Pixels of the picture per metre.
    """
    import open3d

    rays = open3d.t.geometry.RaycastingScene(nthreads=2)
    counts = np.array([len(s.mesh.vertices) for s in surfaces])
    vertex_start = np.concatenate([[0], np.cumsum(counts)])
    face_start = np.concatenate([[0], np.cumsum([len(s.mesh.faces) for s in surfaces])]).astype(np.int32)
    for surface in surfaces:
        rays.add_triangles(
            open3d.core.Tensor.from_numpy(surface.mesh.vertices.astype(np.float32)),
            open3d.core.Tensor.from_numpy(surface.mesh.faces.astype(np.uint32)),
        )
    flat = [s.coordinates if s.coordinates is not None else np.zeros((len(s.mesh.faces), 3, 2)) for s in surfaces]
    light = [_bake(rays, s.mesh) for s in surfaces]
    return RenderScene(
        rays,
        np.array([s.paint for s in surfaces], dtype=np.int32),
        face_start,
        np.concatenate([s.mesh.faces + start for s, start in zip(surfaces, vertex_start, strict=False)]),
        np.concatenate([s.mesh.vertices for s in surfaces]),
        np.concatenate(flat),
        np.concatenate(light),
        np.zeros((1, 1)) if picture is None else (picture / 255.0),
        picture_scale,
    )


def pixel_rays(camera: Intrinsics, world_from_cam: FloatArray, shift: tuple[float, float] = (0.0, 0.0)) -> Any:
    """Rays through all pixels, direction's camera z = 1 so that the hit parameter is the depth; shape (H, W, 6)."""
    u, v = np.meshgrid(np.arange(camera.width) + shift[0], np.arange(camera.height) + shift[1])
    direction = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    direction = direction @ world_from_cam[:3, :3].T
    origin = np.broadcast_to(world_from_cam[:3, 3], direction.shape)
    return np.concatenate([origin, direction], axis=-1).astype(np.float32)


def render(scene: RenderScene, camera: Intrinsics, world_from_cam: FloatArray, *, samples: int = 2) -> FloatArray:
    """A picture without noise.

    Args:
        scene: What to draw.
        camera: Pinhole camera.
        world_from_cam: Its pose, shape (4, 4).
        samples: Rays per pixel along each axis.

    Returns:
        sRGB in 0..1, shape (H, W, 3).
    """
    total = np.zeros((camera.height, camera.width, 3))
    shifts = (np.arange(samples) + 0.5) / samples - 0.5
    for dx in shifts:
        for dy in shifts:
            rays = pixel_rays(camera, world_from_cam, (dx, dy))
            hit = {name: value.numpy() for name, value in scene.rays.cast_rays(rays).items()}
            _shade(
                rays, hit["t_hit"], hit["geometry_ids"], hit["primitive_ids"], hit["primitive_uvs"], scene.paints,
                scene.face_start, scene.faces, scene.vertices, scene.coordinates, scene.light, scene.picture,
                scene.picture_scale, total,
            )  # fmt: skip
    return srgb_curve(np.clip(total / samples**2, 0.0, 1.0))


def area_weighted_normals(mesh: TriangleMesh) -> FloatArray:
    """Area-weighted unit normals, shape (V, 3)."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    normals = np.zeros_like(mesh.vertices)
    for axis in range(3):
        for corner in range(3):
            normals[:, axis] += np.bincount(mesh.faces[:, corner], area[:, axis], len(normals))
    unit: FloatArray = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return unit


def _bake(rays: Any, mesh: TriangleMesh) -> FloatArray:
    """Light that reaches each vertex from in front of the surface and from behind it, shape (V, 2)."""
    normals = area_weighted_normals(mesh)
    light = np.zeros((len(normals), 2))
    for direction, strength in zip(*_lamps(), strict=True):
        facing = normals @ direction
        start = mesh.vertices + np.sign(facing)[:, None] * normals * 6e-4
        bundle = np.concatenate([start, np.broadcast_to(direction, start.shape)], axis=1).astype(np.float32)
        clear = ~rays.test_occlusions(bundle).numpy()
        light[:, 0] += strength * np.maximum(facing, 0.0) * clear
        light[:, 1] += strength * np.maximum(-facing, 0.0) * clear
    return light


def _lamps() -> tuple[FloatArray, FloatArray]:
    """A light tent: directions on a Fibonacci sphere (N, 3) and their strengths (N,), brightest high on the left."""
    index = np.arange(LAMPS) + 0.5
    y = 1.0 - 2.0 * index / LAMPS
    turn = index * np.pi * (3.0 - np.sqrt(5.0))
    direction = np.stack([np.sqrt(1.0 - y * y) * np.sin(turn), y, np.sqrt(1.0 - y * y) * np.cos(turn)], axis=1)
    key = np.maximum(direction @ (np.array([0.55, 0.65, 0.52]) / np.linalg.norm([0.55, 0.65, 0.52])), 0.0) ** 6
    fill = np.maximum(direction @ (np.array([-0.6, 0.3, -0.74]) / np.linalg.norm([-0.6, 0.3, -0.74])), 0.0) ** 3
    strength = 0.75 + 0.35 * y + 3.2 * key + 0.8 * fill
    return direction, strength * 4.0 / LAMPS


@njit(cache=True)
def _shade(
    rays: Any,
    t_hit: Any,
    geometry: Any,
    primitive: Any,
    weights: Any,
    paints: IntArray,
    face_start: IntArray,
    faces: IntArray,
    vertices: FloatArray,
    coordinates: FloatArray,
    light: FloatArray,
    picture: FloatArray,
    picture_scale: float,
    total: FloatArray,
) -> None:
    """Add the linear colour of one ray per pixel to `total`."""
    for row in range(total.shape[0]):
        color = np.zeros(3)
        for column in range(total.shape[1]):
            if not np.isfinite(t_hit[row, column]):
                total[row, column] += BACKDROP * (1.0 - 0.15 * row / total.shape[0])
                continue
            shape = geometry[row, column]
            face = face_start[shape] + primitive[row, column]
            a, b, c = faces[face]
            wb, wc = np.float64(weights[row, column, 0]), np.float64(weights[row, column, 1])
            wa = 1.0 - wb - wc
            point = wa * vertices[a] + wb * vertices[b] + wc * vertices[c]
            uv = wa * coordinates[face, 0] + wb * coordinates[face, 1] + wc * coordinates[face, 2]
            paint = paints[shape]
            if paint == CLOTH:
                textures.woven_print(uv[0], uv[1], color)
            elif paint == LINEN:
                textures.linen(point[0], point[1], point[2], color)
            elif paint == SUIT:
                textures.speckled_suit(point[0], point[1], point[2], color)
            elif paint == FLOOR:
                textures.floor(point[0], point[2], color)
            else:
                i = min(max(int(uv[1] * picture_scale), 0), picture.shape[0] - 1)
                j = min(max(int(uv[0] * picture_scale), 0), picture.shape[1] - 1)
                color[:] = 0.03 + 0.72 * picture[i, j]
            edge_b, edge_c = vertices[b] - vertices[a], vertices[c] - vertices[a]
            normal = np.cross(edge_b, edge_c)
            ray = rays[row, column]
            side = 0 if normal[0] * ray[3] + normal[1] * ray[4] + normal[2] * ray[5] < 0.0 else 1
            arriving = wa * light[a, side] + wb * light[b, side] + wc * light[c, side]
            total[row, column] += color * arriving
