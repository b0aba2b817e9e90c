"""One look along a guessed surface: where its patches lie, by all photos that see them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.geometry.seen.depth_picture import depth_picture
from vto_pipeline.geometry.topology import concatenate, edges, vertex_normals
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.photos.rematch.patches import correlations, mismatch, own_places
from vto_pipeline.scan.photos.rematch.smooth_choice import smooth_choice

STEP_PX = 0.5
"""Between offsets that are tried, in pixels on the surface."""
SAME_PX = 1.5
"""Places that differ by no more are the same."""
LEAST_COSINE = 0.17
"""Photos that see a place at a steeper slant than 80 degrees tell nothing."""
PASSES = 2
"""The second with the slants that the first found."""
MOST_PATCHES = 100_000
"""Of one look, the nearest to what is known."""
PATCH_BYTES = 5000
"""What one takes, with its share of the guessed surface [B]: 0.5 GB for the most."""
PATCH_PIXELS = 250
"""Pixels of photos for each patch at least: they lie six pixels apart, and several photos show each."""
MAP_BYTES = 10
"""Per pixel of every photo: its grey level twice, its depth before and after a look."""
CHUNK = 2000
"""Patches that one thread works on at a time."""


class RematchConfig(Config):
    """Settings of the second look."""

    rounds: int = Field(
        default=6, ge=0, le=10, description="At most; each reaches further into gaps; 0 leaves the second look out"
    )
    views: int = Field(default=7, ge=3, le=20, description="Photos of a place that are compared, the least slanted")
    needed: int = Field(default=2, ge=1, le=12, description="Photos that must each find the place that is chosen")
    radius_px: int = Field(default=5, ge=2, le=15, description="Half side of the compared patches [px]")
    reach_px: float = Field(default=8.0, ge=1, le=50, description="Search on either side of the guess [px]")
    min_correlation: float = Field(default=0.5, ge=-1, le=1, description="Patches that correlate less do not match")


@dataclass(frozen=True)
class GreyPhotos:
    """Undistorted photos in memory, with their cameras.

    Args:
        pictures: Grey levels, shape (C, H, W); smaller photos fill the upper left.
        intrinsics: Without distortion.
        world_from_cam: Rigid transforms [m], shape (C, 4, 4).
    """

    pictures: ByteArray
    intrinsics: tuple[Intrinsics, ...]
    world_from_cam: FloatArray


class Look(NamedTuple):
    """What one look found of P vertices that were looked at, in M photos of each.

    Args:
        last: The surface before the last pass.
        normals: Of its vertices, shape (V, 3).
        moved: Way along them that was chosen [m], shape (V,), 0 for vertices that were not looked at.
        views: Photos of each vertex that was looked at, -1 for none, shape (P, M).
        column: Of the one that the others were held against, -1 for none, shape (P,).
        own: Way that each other photo finds by itself [m], NaN where it finds none, shape (P, M).
        agrees: Which of them find the chosen place, shape (P, M).
        sure: Which vertices have enough of those, shape (P,).
    """

    last: TriangleMesh
    normals: FloatArray
    moved: FloatArray
    views: IntArray
    column: IntArray
    own: FloatArray
    agrees: NDArray[np.bool_]
    sure: NDArray[np.bool_]

    @property
    def mesh(self) -> TriangleMesh:
        """The surface with its vertices in the places chosen."""
        return replace(self.last, vertices=self.last.vertices + self.moved[:, None] * self.normals)


def grey_photos(grays: Iterable[NDArray[np.uint8]], maps: DepthMaps) -> GreyPhotos:
    """Gather the photos of depth maps, undistorted, each of its map's size."""
    pictures = np.zeros(maps.depth.shape, np.uint8)
    for index, gray in enumerate(grays):
        pictures[index, : gray.shape[0], : gray.shape[1]] = gray
    return GreyPhotos(pictures, maps.intrinsics, maps.world_from_cam)


def look_bytes(photos: int, pixels: int) -> float:
    """Return the memory that a look takes at most, for so many photos of so many pixels each [B]."""
    return photos * pixels * MAP_BYTES + PATCH_BYTES * min(MOST_PATCHES, photos * pixels / PATCH_PIXELS)


def look_along(
    mesh: TriangleMesh,
    lacking: IntArray,
    shown: NDArray[np.bool_],
    photos: GreyPhotos,
    pixel: float,
    config: RematchConfig,
    besides: TriangleMesh | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Look:
    """Move vertices of a guessed surface along their normals to where photos agree; neighbours stay together.

    Args:
        mesh: The guess, in the frame of the cameras.
        lacking: The vertices that are looked at, ascending, shape (P,).
        shown: Which vertices are in their place, and hold their neighbours, shape (V,).
        photos: Undistorted.
        pixel: Side of a pixel on the surface [m].
        config: Settings.
        besides: What else may stand before the surface.
        progress: Called with the share done.
    """
    middle = int(np.ceil(config.reach_px / STEP_PX))
    offsets: FloatArray = np.asarray(STEP_PX * pixel * np.arange(-middle, middle + 1), dtype=np.float64)
    for number in range(PASSES):
        normals = vertex_normals(mesh)
        scene = mesh if besides is None else concatenate([mesh, besides])
        places = mesh.vertices[lacking], normals[lacking]
        views = _least_slanted(scene, *places, photos, config.reach_px * pixel, config.views)
        found, column = _correlated(photos, *places, views, offsets, config, pixel, partial(_told, progress, number))
        moved = np.zeros(len(mesh.vertices))
        moved[lacking] = STEP_PX * pixel * (_chosen(mesh, lacking, shown, found, config.needed) - middle)
        own = STEP_PX * pixel * (own_places(found, config.min_correlation) - middle)
        last, mesh = mesh, replace(mesh, vertices=mesh.vertices + moved[:, None] * normals)
    agrees = np.abs(own - moved[lacking, None]) <= SAME_PX * pixel
    return Look(last, normals, moved, views, column, own, agrees, agrees.sum(axis=1) >= config.needed)


def _told(progress: Callable[[float], None], number: int, done: float) -> None:
    progress((number + done) / PASSES)


def _least_slanted(
    scene: TriangleMesh, points: FloatArray, facing: FloatArray, photos: GreyPhotos, lift: float, count: int
) -> IntArray:
    """The photos that see each point (P, 3) at the least slant, best first, -1 for none, shape (P, count).

    A point may be off by `lift`: it is asked for so far in front of itself.
    """

    def cosines(k: int) -> FloatArray:
        lens, pose = photos.intrinsics[k], photos.world_from_cam[k]
        inverse = np.linalg.inv(pose)
        depth = depth_picture(scene, lens, inverse)
        to_eye = pose[:3, 3] - points
        slant = (to_eye * facing).sum(axis=1) / np.linalg.norm(to_eye, axis=1)
        shown, ahead = projected(points + lift * facing, lens, inverse)
        u, v = np.rint(shown[:, :2]).astype(np.int64).T
        inside = ahead & (u >= 0) & (v >= 0) & (u < lens.width) & (v < lens.height) & (slant > LEAST_COSINE)
        inside[inside] = shown[inside, 2] <= depth[v[inside], u[inside]]
        return np.asarray(np.where(inside, slant, 0.0))

    cosine = np.stack(list(in_order(cosines, len(photos.intrinsics))), axis=1)
    order = np.argsort(-cosine, axis=1, kind="stable")[:, :count]
    return np.where(np.take_along_axis(cosine, order, axis=1) > 0, order, -1)


def projected(points: FloatArray, lens: Intrinsics, cam_from_world: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Column, row and depth of points (N, 3) in a photo, shape (N, 3), and which lie ahead of it, shape (N,)."""
    local = points @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    ahead = np.asarray(local[:, 2] > 1e-6)
    z = np.where(ahead, local[:, 2], 1.0)
    return np.column_stack([lens.fx * local[:, 0] / z + lens.cx, lens.fy * local[:, 1] / z + lens.cy, z]), ahead


def _correlated(
    photos: GreyPhotos,
    points: FloatArray,
    normals: FloatArray,
    views: IntArray,
    offsets: FloatArray,
    config: RematchConfig,
    pixel: float,
    progress: Callable[[float], None],
) -> tuple[NDArray[np.float32], IntArray]:
    sizes = np.array([(lens.height, lens.width) for lens in photos.intrinsics], np.int64)
    matrices = np.stack([lens.matrix for lens in photos.intrinsics])
    inverse = np.asarray(np.linalg.inv(photos.world_from_cam), dtype=np.float64)
    where = (photos.pictures, sizes, matrices, inverse)
    count = -(-len(points) // CHUNK)

    def part(index: int) -> tuple[NDArray[np.float32], IntArray]:
        own = slice(index * CHUNK, (index + 1) * CHUNK)
        what = (offsets, config.radius_px, pixel, config.needed)
        found: tuple[NDArray[np.float32], IntArray] = correlations(points[own], normals[own], views[own], *where, *what)
        return found

    parts = []
    for each in in_order(part, count):
        parts.append(each)
        progress(len(parts) / count)
    return np.concatenate([found for found, _ in parts]), np.concatenate([column for _, column in parts])


def _chosen(
    mesh: TriangleMesh, lacking: IntArray, shown: NDArray[np.bool_], found: NDArray[np.float32], held: int
) -> FloatArray:
    """Label of each lacking vertex; those shown stay in their place and hold their neighbours."""
    used = np.zeros(len(shown), dtype=bool)
    used[lacking] = True
    links = edges(mesh)
    links = links[used[links].any(axis=1) & (used | shown)[links].all(axis=1)]
    nodes = np.unique(np.concatenate([lacking, links.ravel()]))
    index = np.full(len(shown), -1)
    index[nodes] = np.arange(len(nodes))
    both = index[np.concatenate([links, links[:, ::-1]])]
    both = both[np.lexsort(both.T[::-1])]
    start = np.searchsorted(both[:, 0], np.arange(len(nodes) + 1))
    key = both[:, 0] * len(nodes) + both[:, 1]
    back = np.searchsorted(key, both[:, 1] * len(nodes) + both[:, 0])
    costs = np.full((len(nodes), found.shape[1]), 2.0, np.float32)
    costs[:, found.shape[1] // 2] = 0.0
    costs[index[lacking]] = mismatch(found, held)
    return np.asarray(smooth_choice(costs, start, both[:, 1].copy(), back)[index[lacking]])
