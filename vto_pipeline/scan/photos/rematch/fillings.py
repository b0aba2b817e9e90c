"""A look at cloth that was filled, with the filling as the guess."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthMaps, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.scan.depth_views import depth_only, pixel_on_surface
from vto_pipeline.scan.photos.neighbours import visibility
from vto_pipeline.scan.photos.rematch.look import MOST_PATCHES, RematchConfig, grey_photos, look_along, look_bytes
from vto_pipeline.scan.photos.views import stereo_views

VIEWS = 5
"""Photos of a place that are compared: two more cost a third again, and bring nothing."""


def look_at_fillings(
    surface: TriangleMesh,
    filled: NDArray[np.bool_],
    besides: TriangleMesh | None,
    photos: PhotoSet,
    cameras: CameraSet,
    cloud: PointCloud,
    maps: DepthMaps,
    job: Job,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Find where photos show cloth that was filled.

    Stereo loses cloth whose place nothing near tells, though several photos show it. A filling that a mannequin guides
    is a nearer guess than a surface closed through confirmed depth. Beside a rim a patch shows what is behind, too:
    nothing is looked for there.

    Args:
        surface: The garment with its fillings, in the frame of the cameras.
        filled: Which of its vertices were filled, shape (V,).
        besides: What else may hide cloth, or None.
        photos: The photos' files.
        cameras: Poses of those that were registered.
        cloud: Sparse points, for the grey in which the print shows best.
        maps: Depth of the photos, as stereo left it: the size in which they are read, and of a pixel on the surface.
        job: Receives progress, and a note where the memory does not allow a look.

    Returns:
        Places of the vertices [m], shape (V, 3), and which of them two more photos find there, shape (V,): no other
        has moved.

    Raises:
        InputError: a camera names a photo that is not there.
        ScanError: no depth map holds a reading.
    """
    nobody = np.zeros(len(filled), dtype=bool)
    needed, free = look_bytes(len(maps.depth), maps.depth[0].size), job.memory_left()
    if needed > free:
        job.note(f"no look at what was filled: it takes {needed / 1e9:.1f} GB of memory; {free / 1e9:.1f} GB are left")
        return surface.vertices, nobody
    pixel = pixel_on_surface(depth_only(maps))
    config = RematchConfig(views=VIEWS)
    lacking = np.flatnonzero(filled & ~_beside_rims(surface, config.radius_px * pixel))
    if len(lacking) > MOST_PATCHES and not filled.all():
        away, _ = cKDTree(surface.vertices[~filled]).query(surface.vertices[lacking])
        lacking = lacking[np.sort(np.argsort(away, kind="stable")[:MOST_PATCHES])]
    if len(lacking) == 0:
        return surface.vertices, nobody
    side = max(max(lens.width, lens.height) for lens in maps.intrinsics)
    views = stereo_views(photos, cameras, cloud, visibility(cameras, cloud), side, Job(seed=job.seed))
    grays = grey_photos((undistorted(view.gray, view.camera) for view in views), maps)
    look = look_along(
        surface,
        lacking.astype(np.int32),
        ~filled,
        grays,
        pixel,
        config,
        besides,
        lambda share: job.progress(0.6 + 0.3 * share, f"looking again at {len(lacking)} filled vertices"),
    )
    found = nobody.copy()
    found[lacking[look.sure]] = True
    return np.where(found[:, None], look.mesh.vertices, surface.vertices), found


def _beside_rims(surface: TriangleMesh, distance: float) -> NDArray[np.bool_]:
    """Which vertices are no farther from a border than this [m], shape (V,)."""
    loops = boundary_loops(surface)
    if not loops:
        return np.zeros(len(surface.vertices), dtype=bool)
    away, _ = cKDTree(surface.vertices[np.concatenate(loops)]).query(surface.vertices)
    return np.asarray(away <= distance)
