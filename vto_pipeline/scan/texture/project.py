"""A picture on a scanned surface, from the photos that the surface was scanned with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import InputError, ScanError
from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.smooth import smooth_values
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.exposure import relative_levels
from vto_pipeline.scan.texture.charts import Texels, nearest_pixel, texels_of, unwrap
from vto_pipeline.scan.texture.colors import blend, coarse_band, coarse_logs, read_colors
from vto_pipeline.scan.texture.fill import fill_between, fill_vertices
from vto_pipeline.scan.texture.rim import form_at_rims
from vto_pipeline.scan.texture.views import Samples, View, lens_of, look, no_photo, pixel_size, rank_view

NORMAL_ROUNDS = 5
"""Of smoothing the normals, so that noise of the surface does not decide which photo is the best."""

LEVEL_POINTS = 4000
"""Points by which the photos' brightness and white balance are compared."""


class TextureConfig(Config):
    """Settings of the texture."""

    max_triangles: int = Field(30_000, ge=1_000, le=5_000_000, description="A finer surface is thinned out first")
    max_side_px: int = Field(4096, ge=64, le=16384, description="Longest side of the picture [px]")
    texel_pixels: float = Field(0.7, gt=0.1, le=10, description="Side of a texel, in pixels of the photos")
    views: int = Field(6, ge=1, le=16, description="Photos that a texel's colour is taken from, the best ones")
    max_angle_deg: float = Field(75.0, gt=0, lt=90, description="Between a photo's line of sight and the normal [deg]")
    border_pixels: float = Field(2.0, ge=0, le=50, description="Not used: pixels this near to something else [px]")
    slack_mm: float = Field(10.0, ge=0, le=200, description="What was scanned hides nothing nearer behind it [mm]")
    band_pixels: float = Field(5.0, gt=0, le=100, description="Coarser colours are averaged over photos [px]")
    detail_power: float = Field(8.0, ge=1, le=64, description="How nearly all fine detail is the best photo's")
    tolerance: float = Field(16.0, gt=0, le=255, description="Photos further from the median are left out [of 255]")


def texture_surface(
    mesh: TriangleMesh,
    occluder: TriangleMesh | None,
    photos: PhotoSet,
    cameras: CameraSet,
    config: TextureConfig,
    job: Job,
    form: ByteArray | None = None,
) -> TexturedMesh:
    """Lay the surface out flat and colour each texel from the photos that show it.

    Args:
        mesh: The surface, its outside counter-clockwise [m].
        occluder: Whatever else was in the scene [m], or None; it may hold the surface itself.
        photos: The photos.
        cameras: That took them, in the frame of the surface.
        config: Settings.
        job: Receives progress and figures.
        form: Colours of what the surface was cut off, shape (B, 3), or None; at rims they do not count as seen.

    Raises:
        InputError: a camera names a photo that is not there; ScanError: no photo shows the surface.
    """
    paths = {path.name: path for path in photos.paths}
    missing = [name for name in cameras.names if name not in paths]
    if missing:
        raise InputError(f"there is a camera but no photo for {missing[0]}", where=str(photos.paths[0].parent))
    mesh = decimate(mesh, config.max_triangles)
    normals = smooth_values(mesh, vertex_normals(mesh), NORMAL_ROUNDS)
    pixel = pixel_size(mesh, cameras)
    if not np.isfinite(pixel):
        raise ScanError("no photo shows the surface", hint="do the cameras belong to this surface?")
    job.progress(0.0, "charts")
    corners, size = unwrap(mesh, config.texel_pixels * pixel, config.max_side_px)
    texels = texels_of(corners, size)
    samples = _samples(mesh, texels)

    best, score = no_photo(len(samples.face), config.views)
    least = float(np.cos(np.radians(config.max_angle_deg)))
    masks = []

    def look_from(k: int) -> View:
        return look(mesh, occluder, cameras.intrinsics[k], cameras.world_from_cam[k], 1e-3 * config.slack_mm)

    for index, view in enumerate(in_order(look_from, len(cameras.names))):
        job.progress(0.2 + 0.4 * index / len(cameras.names), "which photos show each texel")
        rank_view(
            index, mesh.vertices, normals, mesh.faces, *samples, lens_of(cameras.intrinsics[index]),
            view.cam_from_world, view.depth, view.inside, least, config.border_pixels, best, score,
        )  # fmt: skip
        masks.append(np.packbits(view.inside > 1.0, axis=1))
    low, high = (np.zeros((*best.shape, 3), np.int16) for _ in range(2))

    def read(k: int) -> tuple[ByteArray, NDArray[np.float32]]:
        camera, picture = cameras.intrinsics[k], read_image(paths[cameras.names[k]])
        mask = np.unpackbits(masks[k], axis=1, count=camera.width)
        return picture, coarse_band(undistorted(picture, camera), mask, config.band_pixels)

    for index, (picture, coarse) in enumerate(in_order(read, len(cameras.names))):
        job.progress(0.6 + 0.3 * index / len(cameras.names), "colours")
        camera, cam_from_world = cameras.intrinsics[index], np.linalg.inv(cameras.world_from_cam[index])
        read_colors(
            index, mesh.vertices, mesh.faces, *samples, lens_of(camera), camera.k1, cam_from_world,
            picture, coarse, best, low, high,
        )  # fmt: skip
    gain = _gains(best, low, len(texels.face), len(cameras.names))
    color, seen = blend(best, score, low, high, gain, config.tolerance, config.detail_power)
    if form is not None:
        seen[form_at_rims(mesh, samples, color, seen > 0, form)] = 0
    return _assemble(mesh, corners, size, texels, color, seen, job)


def _samples(mesh: TriangleMesh, texels: Texels) -> Samples:
    """The texels, then the mesh's vertices, each at a corner of one of its faces."""
    corner = np.zeros(len(mesh.vertices), dtype=np.int64)
    corner[mesh.faces.reshape(-1)] = np.arange(mesh.faces.size)
    weight = np.eye(3, dtype=np.float32)[corner % 3]
    return Samples(
        np.concatenate([texels.face, corner // 3]).astype(np.int32),
        np.concatenate([texels.weight.astype(np.float32), weight]),
    )


def _gains(best: NDArray[np.int16], low: NDArray[np.int16], texels: int, photos: int) -> FloatArray:
    """What levels the photos' brightness and white balance, told by the vertices, shape (C, 3)."""
    step = max(1, (len(best) - texels) // LEVEL_POINTS)
    logs = coarse_logs(best[texels::step], low[texels::step], photos)
    return 1.0 / np.stack([relative_levels(log) for log in logs], axis=1)


def _assemble(
    mesh: TriangleMesh,
    corners: FloatArray,
    size: tuple[int, int],
    texels: Texels,
    color: NDArray[np.float32],
    seen: NDArray[np.uint8],
    job: Job,
) -> TexturedMesh:
    count = len(texels.face)
    known = seen > 0
    vertices = fill_vertices(mesh, color[count:].astype(np.float64), known[count:])
    unseen = ~known[:count]
    around = vertices[mesh.faces[texels.face[unseen]]]
    color[:count][unseen] = np.einsum("nk,nkc->nc", texels.weight[unseen], around)
    width, height = size
    picture, inside, mask = np.zeros((height, width, 3), np.uint8), *np.zeros((2, height, width), dtype=bool)
    own = texels.inside | (known[:count] & _edge_known(size, texels, known[:count]))  # or the edge's colour goes on
    picture[texels.row[own], texels.column[own]] = np.rint(color[:count][own])
    inside[texels.row[own], texels.column[own]] = True
    mask[texels.row, texels.column] = known[:count]
    shown = seen[:count][texels.inside]
    job.measure(texture_px=max(size), texels=len(shown), textured_share=round(float((shown > 0).mean()), 4))
    job.measure(photos_per_texel=round(float(shown[shown > 0].mean()) if shown.any() else 0.0, 2))
    surface = TriangleMesh(mesh.vertices, mesh.faces, np.rint(vertices).astype(np.uint8), corners, mesh.metric)
    return TexturedMesh(surface, fill_between(picture, inside), mask)


def _edge_known(size: tuple[int, int], texels: Texels, known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each texel whether a photo shows its chart there, shape (N,): a margin lies beside the surface."""
    chart, lit = np.zeros((2, size[1], size[0]), dtype=bool)
    chart[texels.row[texels.inside], texels.column[texels.inside]] = True
    lit[texels.row, texels.column] = known
    return np.asarray(lit.reshape(-1)[nearest_pixel(chart)[1][texels.row, texels.column]])
