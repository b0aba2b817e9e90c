"""Metric scale of photos from the height of the person or the form that stands in them.

A quick surface from small photos is enough: what its ends are uncertain by is small beside the whole height.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import ScanError
from vto_pipeline.geometry.topology import boundary_loops, component_areas, face_areas, submesh, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.scan.fuse import FuseConfig, fuse_depth_maps
from vto_pipeline.scan.photos.stereo import StereoConfig, estimate_depth_maps

SIDE_PX = 600
"""Photos are scaled down to this longer side [px]."""
LEVEL_DEG = 25.0
"""The floor is a plane that is level within this, as cameras are held."""
TRIES = 500
"""Planes through three points that are tried."""
FLAT = 0.006
"""What is so near to a plane lies on it [share of the surface's height]."""
BENEATH = 0.02
"""Under a floor lies no more than this share of the surface."""
LEAST_FLOOR = 0.02
"""A floor is at least so large [share of the square of the surface's height]."""
CLEAR = 0.03
"""What stands begins so far above the floor, where the two are one surface [share of the surface's height]."""
CROWN = 0.01
"""The top is closed if no rim is so near to it [share of the height]."""
CAP, MOST_ADDED = 0.06, 0.02
"""A hole in the top is rounded off as the cap around it is, down to so far below; it adds so much at most [share of the
height]. Photos from the level of the eyes do not show the crown of a head."""
POSTURE_M = 0.01
"""Standard deviation of how tall one stands from how tall one is measured, hair and soles included [m]."""


def scale_from_stature(
    photos: PhotoSet, cameras: CameraSet, cloud: PointCloud, stature: float, job: Job
) -> tuple[float, float]:
    """Return metres per unit, and its standard error as a share.

    Args:
        photos: That show the floor, and on it the whole person or form.
        cameras, cloud: Up to scale, +Y roughly up.
        stature: From the floor to the top [m].
        job: Receives progress; gives the seed and the memory.

    Raises:
        ScanError: what was seen of the floor or of the top does not tell the height.
    """
    job.progress(0.1, "a quick look at what stands there, for its height")
    quick = StereoConfig.model_validate({"max_side_px": SIDE_PX, "rematch": {"rounds": 0}})
    aside = Job(scratch=job.scratch, seed=job.seed, memory=job.memory)
    maps = estimate_depth_maps(photos, cameras, cloud, quick, aside)
    job.progress(0.7, "a quick surface of what stands there")
    surface = fuse_depth_maps(photos, cameras, maps, FuseConfig.model_validate({}), aside)
    height, error = standing_height(surface, job.seed)
    return stature / height, float(np.hypot(error / height, POSTURE_M / stature))


def standing_height(surface: TriangleMesh, seed: int = 0) -> tuple[float, float]:
    """Return how high the largest thing on the floor of a surface is, and its standard error, in the surface's unit.

    Args:
        surface: Open where nothing was seen, +Y roughly up.
        seed: Of the planes that are tried.

    Raises:
        ScanError: there is no floor, nothing that stands on it, or its top was not seen.
    """
    floor = _floor(surface, np.random.default_rng(seed))
    if floor is None:
        raise ScanError(
            "the stature gives no scale: the photos do not show the floor",
            hint="lay newspaper or a printed mat around the feet, or state a distance between two points",
        )
    above = surface.vertices @ floor[:3] + floor[3]
    whole = float(above.max())
    risen: NDArray[np.bool_] = np.asarray((above > CLEAR * whole)[surface.faces].all(axis=1))
    piece, areas = component_areas(submesh(surface, risen)[0])
    stands, kept = submesh(surface, _faces_of(risen, piece == int(np.argmax(areas))))
    above = above[kept]
    if above.min() > 2.0 * CLEAR * float(above.max()):
        raise ScanError(
            "the stature gives no scale: the largest thing that was seen does not reach the floor",
            hint="plain legs and stands are lost: state a distance between two points, or lay a printed board there",
        )
    edge = float(np.sqrt(2.0 * face_areas(stands).mean()))
    added = _unseen_top(stands, above, floor[:3])
    return float(above.max()) + added, float(np.hypot(edge, added / 2.0))


def _unseen_top(stands: TriangleMesh, above: FloatArray, up: FloatArray) -> float:
    """Return how far a thing goes on above its highest vertex: 0 where that is closed, else as a sphere through the cap
    around the hole (least squares).

    Raises:
        ScanError: it goes on by more than is missing of a crown.
    """
    top, height = int(np.argmax(above)), float(above.max())
    rims = np.concatenate([np.empty(0, np.int32), *boundary_loops(stands)])
    if not (np.linalg.norm(stands.vertices[rims] - stands.vertices[top], axis=1) < CROWN * height).any():
        return 0.0
    cap = (stands.vertices[above > (1.0 - CAP) * height] - stands.vertices[top]) / height
    equation = np.column_stack([2.0 * cap, np.ones(len(cap))])
    middle = np.linalg.lstsq(equation, (cap**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(middle[3] + middle[:3] @ middle[:3], 0.0)))
    added = float(middle[:3] @ up) + radius
    if not 0.0 <= added < MOST_ADDED:
        raise ScanError(
            "the stature gives no scale: the top of what stands there was not seen",
            hint="wear a printed cap over dark hair, take photos from above, or state a distance between two points",
        )
    return added * height


def _faces_of(risen: NDArray[np.bool_], chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which faces of a surface are the chosen of those that rise."""
    faces = risen.copy()
    faces[risen] = chosen
    return faces


def _floor(surface: TriangleMesh, random: np.random.Generator) -> FloatArray | None:
    """Return the floor's plane, unit normal upward and offset (4,), or None: that level plane under which next to
    nothing lies, and on which most of the surface does (RANSAC, Fischler and Bolles 1981)."""
    points, normals = surface.vertices, vertex_normals(surface)
    area = np.bincount(surface.faces.ravel(), np.repeat(face_areas(surface) / 3.0, 3), len(points))
    high = float(np.ptp(points[:, 1]))
    least, steep = LEAST_FLOOR * high**2, np.cos(np.radians(LEVEL_DEG))
    level = np.flatnonzero(normals[:, 1] > steep)
    best, most = None, least
    for _ in range(TRIES if len(level) >= 3 else 0):
        a, b, c = points[random.choice(level, 3, replace=False)]
        plane = _plane(np.cross(b - a, c - a), a)
        if plane is None or plane[1] < steep:
            continue
        off = points @ plane[:3] + plane[3]
        on = (np.abs(off) < FLAT * high) & (normals @ plane[:3] > steep)
        if area[on].sum() > most and area[off < -2 * FLAT * high].sum() < BENEATH * area.sum():
            best, most = on, float(area[on].sum())
    if best is None:
        return None
    middle = np.average(points[best], axis=0, weights=area[best])
    spread = (points[best] - middle) * np.sqrt(area[best])[:, None]
    return _plane(np.linalg.svd(spread, full_matrices=False)[2][2], middle)


def _plane(normal: FloatArray, point: FloatArray) -> FloatArray | None:
    """Return the plane through a point across a direction, its normal upward, shape (4,); None for no direction."""
    length = float(np.linalg.norm(normal))
    if length < 1e-12:
        return None
    unit = normal / np.copysign(length, normal[1])
    return np.array([*unit, -unit @ point])
