"""Look again, along a guessed surface, for what the depth maps lack."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial import cKDTree

from vto_pipeline.geometry.seen.depth_picture import depth_picture
from vto_pipeline.geometry.topology import edges, vertex_normals
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.rasterise import rasterise
from vto_pipeline.scan.depth_views import depth_only, pixel_on_surface, supporting_views
from vto_pipeline.scan.in_order import in_order
from vto_pipeline.scan.photos.rematch.guess import guess_surface
from vto_pipeline.scan.photos.rematch.patches import best_mean, correlations
from vto_pipeline.scan.photos.rematch.smooth_choice import peak, smooth_choice

STEP_PX = 0.5
"""Between offsets that are tried, in pixels on the surface."""
SAME_PX = 1.5
"""Places that differ by no more are the same."""
SUPPORT_PX = 2.0
"""Depth maps within this distance show a place of the surface."""
FARTHEST_PX = 40.0
"""Nothing is guessed farther than this from all confirmed depth."""
LITTLE = 0.002
"""A look that adds a smaller share to the depth is the last."""
LEAST_COSINE = 0.17
"""Photos that see a place at a steeper slant than 80 degrees tell nothing."""
PASSES = 2
"""The second with the slants that the first found."""
MOST_PATCHES = 100_000
"""Of one look, the nearest to confirmed depth."""
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
class _Photos:
    """What the kernels need of the photos."""

    pictures: ByteArray
    sizes: IntArray
    matrices: FloatArray
    cam_from_world: FloatArray


def rematch(grays: Iterable[NDArray[np.uint8]], maps: DepthMaps, config: RematchConfig, job: Job) -> DepthMaps:
    """Add depth that two photos alone did not give: patches of a guessed surface are matched in all that see them.

    Semi-global matching compares upright windows, and loses what neither photo of a pair sees squarely. A closed
    surface through the depth there is tells place and slant of the rest nearly enough. Its patches are moved along
    their normals to where the photos agree, and neighbours stay together. Each photo keeps the depth that it finds.

    Args:
        grays: The maps' photos, undistorted, each of its map's size.
        maps: Confirmed depths.
        config: Settings.
        job: Receives the share of pixels added, and progress.

    Returns:
        The maps with depth added where there was none.

    Raises:
        ScanError: no surface can be guessed.
    """
    pixel = pixel_on_surface(depth_only(maps))
    pictures = np.zeros(maps.depth.shape, np.uint8)
    for index, gray in enumerate(grays):
        pictures[index, : gray.shape[0], : gray.shape[1]] = gray
    photos = _Photos(
        pictures,
        np.array([(lens.height, lens.width) for lens in maps.intrinsics], np.int64),
        np.stack([lens.matrix for lens in maps.intrinsics]),
        np.asarray(np.linalg.inv(maps.world_from_cam), dtype=np.float64),
    )
    before = int((maps.depth > 0).sum())
    known = before
    for number in range(config.rounds):
        maps = _round(photos, maps, pixel, config)
        last, known = known, int((maps.depth > 0).sum())
        job.progress(0.95 + 0.05 * (number + 1) / config.rounds, f"second look {number + 1} of {config.rounds} at most")
        if known - last < LITTLE * last:
            break
    job.measure(rematched_share=round(1.0 - before / known, 3))
    return maps


def look_bytes(photos: int, pixels: int) -> float:
    """Return the memory that the second look takes at most, for so many photos of so many pixels each [B]."""
    return photos * pixels * MAP_BYTES + PATCH_BYTES * min(MOST_PATCHES, photos * pixels / PATCH_PIXELS)


def _round(photos: _Photos, maps: DepthMaps, pixel: float, config: RematchConfig) -> DepthMaps:
    """One look at all that lacks depth: where the last one found nothing, too, for the guess is a better one now."""
    mesh, points = guess_surface(maps, pixel)
    shown = supporting_views(depth_only(maps), mesh.vertices, SUPPORT_PX * pixel) >= 2
    distance, _ = cKDTree(points).query(mesh.vertices, distance_upper_bound=FARTHEST_PX * pixel)
    distance[shown] = np.inf
    nearest = np.argsort(distance, kind="stable")[: min(MOST_PATCHES, int(np.isfinite(distance).sum()))]
    lacking: IntArray = np.sort(nearest).astype(np.int32)
    if len(lacking) == 0:
        return maps
    middle = int(np.ceil(config.reach_px / STEP_PX))
    offsets: FloatArray = np.asarray(STEP_PX * pixel * np.arange(-middle, middle + 1), dtype=np.float64)
    for _ in range(PASSES):
        normals = vertex_normals(mesh)
        views = _least_slanted(mesh, normals, lacking, maps, config.reach_px * pixel, config.views)
        found, column = _correlated(photos, mesh.vertices[lacking], normals[lacking], views, offsets, config, pixel)
        moved = np.zeros(len(mesh.vertices))
        moved[lacking] = STEP_PX * pixel * (_chosen(mesh, lacking, shown, found, config.needed) - middle)
        own = STEP_PX * pixel * (_own_places(found, config.min_correlation) - middle)
        last, mesh = mesh, replace(mesh, vertices=mesh.vertices + moved[:, None] * normals)
    agrees = np.abs(own - moved[lacking, None]) <= SAME_PX * pixel
    sure = agrees.sum(axis=1) >= config.needed
    # per photo, the way of each vertex along its normal; unknown where the photo does not see it or finds it elsewhere
    ways = np.full((len(maps.names), len(mesh.vertices)), np.nan)
    ways[:, shown] = 0.0
    ways[views[sure, column[sure]], lacking[sure]] = moved[lacking[sure]]
    place, other = np.nonzero(agrees & sure[:, None])
    ways[views[place, other], lacking[place]] = own[place, other]
    new = np.zeros(len(mesh.vertices), dtype=bool)
    new[lacking[sure]] = True
    return _filled(maps, last, normals, moved, ways, new)


def _least_slanted(
    mesh: TriangleMesh, normals: FloatArray, chosen: IntArray, maps: DepthMaps, lift: float, count: int
) -> IntArray:
    """The photos that see each vertex at the least slant, best first, -1 for none, shape (P, count).

    A vertex may be off by `lift`: it is asked for so far in front of itself.
    """
    points, facing = mesh.vertices[chosen], normals[chosen]
    cosine = np.zeros((len(chosen), len(maps.names)))
    for k, (lens, pose) in enumerate(zip(maps.intrinsics, maps.world_from_cam, strict=True)):
        inverse = np.linalg.inv(pose)
        depth = depth_picture(mesh, lens, inverse)
        to_eye = pose[:3, 3] - points
        slant = (to_eye * facing).sum(axis=1) / np.linalg.norm(to_eye, axis=1)
        shown, ahead = _projected(points + lift * facing, lens, inverse)
        u, v = np.rint(shown[:, :2]).astype(np.int64).T
        inside = ahead & (u >= 0) & (v >= 0) & (u < lens.width) & (v < lens.height) & (slant > LEAST_COSINE)
        inside[inside] = shown[inside, 2] <= depth[v[inside], u[inside]]
        cosine[inside, k] = slant[inside]
    order = np.argsort(-cosine, axis=1, kind="stable")[:, :count]
    return np.where(np.take_along_axis(cosine, order, axis=1) > 0, order, -1)


def _projected(
    points: FloatArray, lens: Intrinsics, cam_from_world: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Column, row and depth of points (N, 3) in a photo, shape (N, 3), and which lie ahead of it, shape (N,)."""
    local = points @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    ahead = np.asarray(local[:, 2] > 1e-6)
    z = np.where(ahead, local[:, 2], 1.0)
    return np.column_stack([lens.fx * local[:, 0] / z + lens.cx, lens.fy * local[:, 1] / z + lens.cy, z]), ahead


def _correlated(
    photos: _Photos,
    points: FloatArray,
    normals: FloatArray,
    views: IntArray,
    offsets: FloatArray,
    config: RematchConfig,
    pixel: float,
) -> tuple[NDArray[np.float32], IntArray]:
    where = (photos.pictures, photos.sizes, photos.matrices, photos.cam_from_world)

    def part(index: int) -> tuple[NDArray[np.float32], IntArray]:
        own = slice(index * CHUNK, (index + 1) * CHUNK)
        what = (offsets, config.radius_px, pixel, config.needed)
        found: tuple[NDArray[np.float32], IntArray] = correlations(points[own], normals[own], views[own], *where, *what)
        return found

    parts = list(in_order(part, -(-len(points) // CHUNK)))
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
    costs[index[lacking]] = _mismatch(found, held)
    return np.asarray(smooth_choice(costs, start, both[:, 1].copy(), back)[index[lacking]])


@njit(cache=True, nogil=True)
def _mismatch(found, held):  # type: ignore[no-untyped-def]  # typed by Numba
    """One less the mean correlation of the best `held` photos (P, O); one where there are fewer."""
    costs = np.ones(found.shape[:2], np.float32)
    for p in range(costs.shape[0]):
        for o in range(costs.shape[1]):
            costs[p, o] -= max(best_mean(found[p, o], held), 0.0)
    return costs


@njit(cache=True, nogil=True)
def _own_places(found, least):  # type: ignore[no-untyped-def]  # typed by Numba
    """Label at which each photo alone correlates best (P, M); NaN where it correlates less than `least`."""
    patches, labels, photos = found.shape
    places = np.full((patches, photos), np.nan)
    for p in range(patches):
        for m in range(photos):
            best, at = least, -1
            for o in range(labels):
                if found[p, o, m] >= best:
                    best, at = found[p, o, m], o
            if at > 0 and at < labels - 1:  # at an end, it may be better beyond
                places[p, m] = peak(found[p, :, m], at)
    return places


def _filled(
    maps: DepthMaps,
    mesh: TriangleMesh,
    normals: FloatArray,
    moved: FloatArray,
    ways: FloatArray,
    new: NDArray[np.bool_],
) -> DepthMaps:
    """The maps, with the depth of faces whose corners each photo knows, where it had none."""
    depth = maps.depth.copy()
    fresh = new[mesh.faces].any(axis=1)
    for k, (lens, pose) in enumerate(zip(maps.intrinsics, maps.world_from_cam, strict=True)):
        known = np.isfinite(ways[k])
        placed, ahead = _projected(
            mesh.vertices + np.where(known, ways[k], moved)[:, None] * normals, lens, np.linalg.inv(pose)
        )
        whole = np.flatnonzero(ahead[mesh.faces].all(axis=1))
        face, _, away = rasterise(placed[mesh.faces[whole]], lens.width, lens.height)
        good = (fresh & known[mesh.faces].all(axis=1))[whole]
        own = depth[k, : lens.height, : lens.width]
        add = (face >= 0) & good[face] & (own == 0)
        own[add] = away[add]
    depth.flags.writeable = False
    return replace(maps, depth=depth)
