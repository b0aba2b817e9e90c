"""Cameras adjusted to what neighbouring photos show of thousands of points, not only of features.

Features of a faint print are few, and placed to half a pixel: cameras are then off by more than the depths that stereo
compares. `tracks` adds sightings that are many and sharp, and one more bundle adjustment takes both.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.grey import best_shares, in_grey
from vto_pipeline.scan.library_message import COLMAP_ERRORS, library_message
from vto_pipeline.scan.photos.matching.mapping import STRAIGHT, bend, lens_of
from vto_pipeline.scan.photos.matching.tracks import TrackedPhoto, follow, without_light

LONGER_SIDE = 1600
"""Larger photos are scaled down to this [px]."""
NEIGHBOURS, LEAST_SHARED = 8, 5
"""Photos that each photo is compared with, and the sparse points that they share with it at least."""
NARROWEST_DEG, WIDEST_DEG = 2.0, 45.0
"""Photos that see their common points from nearer directions tell nothing, from farther ones they look different."""
LEAST_VIEWS = 3
"""Photos that show a point: with two, what flowed wrongly along the ray is not noticed."""
FAR_OFF_PX = 6.0
"""A sighting so far from where its point would be shown is wrong, however the cameras are adjusted [px]."""
SOFT_PX = 0.4
"""Errors beyond this lose their weight [px]."""
LENS = 50
"""So many points a photo, spread as they are, tell how the lens bends; with fewer it stays as it was found."""
COLORED = 12
"""So many photos tell in which grey their print shows best."""
USUAL_BEND = 0.01
"""A lens about which nothing is known moves a picture's corner by about so much [share of its distance]."""
INDEPENDENT = 30
"""Sightings of a photo that err each on its own, however many there are: neighbours share light and what hides them."""
SHOWN_BEND = 0.002
"""A lens that bends less is left as it was found: a pixel at the corner of a picture of 800 [share]."""
SPOILT = 1.2
"""An adjustment after which the features' own points are off by so many times as much has failed."""


Track = tuple[FloatArray, list[tuple[int, int]]]
"""A point (3,), and its sightings: photo, and number of its place there."""


def adjust(model: Any, photos: PhotoSet, job: Job) -> Any:
    """Return a pycolmap Reconstruction with its cameras adjusted; its points are those it had.

    Args:
        model: Placed photos and sparse points.
        photos: Their files.
        job: Receives how many points were added for the adjustment; notified where it failed.
    """
    import cv2

    before = _own_error(model)
    try:
        adjusted, added = _adjust(copy.deepcopy(model), photos, job)
    except (*COLMAP_ERRORS, cv2.error) as error:
        job.note(f"cameras stay as their features placed them: {library_message(error)}")
        return model
    after = _own_error(adjusted)
    if not after <= SPOILT * before:
        job.note(f"cameras stay as their features placed them: an adjustment takes {before:.2f} px to {after:.2f}")
        return model
    job.measure(tracked_points=added)
    return adjusted


def solve(model: Any, soft_px: float, bent: bool) -> float:
    """Adjust a model's cameras, points and their errors to its sightings, in place, and return what is left.

    Args:
        model: A pycolmap Reconstruction.
        soft_px: Errors beyond this lose their weight [px].
        bent: Whether the lens's distortion is adjusted, too.

    Returns:
        The sum of the losses: half of each squared error, less for those beyond `soft_px` [px²].

    Raises:
        ValueError: no solution was found.
    """
    import pycolmap

    options = pycolmap.BundleAdjustmentOptions(refine_extra_params=bent, print_summary=False)
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = soft_px
    options.ceres.solver_options.num_threads = 1  # with more, the last bits change from run to run
    options.ceres.solver_options.max_num_iterations = 50
    options.ceres.solver_options.function_tolerance = 1e-6
    gauge = pycolmap.BundleAdjustmentConfig()
    for number in sorted(number for number, image in model.images.items() if image.has_pose):
        gauge.add_image(number)
    gauge.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    solved: Any = pycolmap.create_default_bundle_adjuster(options, gauge, model).solve()
    if not solved.is_solution_usable():
        raise ValueError(solved.brief_report())
    model.update_point_3d_errors()  # COLMAP leaves those from before
    return float(solved.ceres_summary.final_cost)


def _from_both_sides(model: Any) -> tuple[Any, float]:
    """Return a model adjusted, lens and all, and what is left; of a lens found much bent, from there and from a
    straight one.

    Focal length, bend and the depths of points make up for each other: the sum of losses has more than one minimum.
    """
    straight = copy.deepcopy(model) if bend(model) > STRAIGHT else None
    cost = solve(model, SOFT_PX, bent=True)
    if straight is None:
        return model, cost
    _bend_lenses(straight, 0.0)
    try:
        other = solve(straight, SOFT_PX, bent=True)
    except ValueError:  # no way from there
        return model, cost
    return (straight, other) if other < cost else (model, cost)


def _as_bent_as_shown(model: Any) -> Any:
    """Return a model adjusted, its lenses as bent as its sightings tell.

    Least squares finds some bend in any photos, and the more, the less these tell of it: it then explains what their
    sightings have wrong alike. So the bend has a prior about 0 (Bishop 2006, "Pattern recognition and machine
    learning", section 3.3) of the breadth `USUAL_BEND`. It has the wide tails of Student's, since some lenses are made
    to bend by ten times as much, and show it. The loss is taken as a parabola in the bend, known by its lowest point
    and by its value for a straight lens; the most probable bend lies between.
    """
    found, cost = _from_both_sides(model)
    if bend(found) < SHOWN_BEND:
        return found
    straight = copy.deepcopy(found)
    _bend_lenses(straight, 0.0)
    try:
        gain = max(solve(straight, SOFT_PX, bent=False) - cost, 0.0)
    except ValueError:  # a straight lens explains nothing
        return found
    variance = cost / (INDEPENDENT * found.num_reg_images())
    _bend_lenses(found, _most_probable_share(gain / variance, bend(found)))
    solve(found, SOFT_PX, bent=False)
    return found


def _most_probable_share(gain: float, bent: float) -> float:
    """Return the share t of a bend that is left: the least of gain (1 - t)² + ln(1 + ½ (t bent / usual)²).

    Args:
        gain: By how much the sightings speak for the bend found, and not for none, as a logarithm of probability.
        bent: The bend found [share].
    """
    usual_sq = (bent / USUAL_BEND) ** 2
    level = np.roots([gain * usual_sq, -gain * usual_sq, 2.0 * gain + usual_sq, -2.0 * gain])  # where its slope is 0
    shares = np.append(level.real[np.abs(level.imag) < 1e-9], [0.0, 1.0]).clip(0.0, 1.0)
    return float(shares[np.argmin(gain * (1.0 - shares) ** 2 + np.log1p(0.5 * usual_sq * shares**2))])


def _bend_lenses(model: Any, share: float) -> None:
    """Leave a share of its bend to each lens of a model."""
    for camera in model.cameras.values():
        focal, cx, cy, k1 = camera.params
        camera.params = [focal, cx, cy, share * k1]


def _own_error(model: Any) -> float:
    """Return the error of a model's points that sets their mean loss [px]: wrong sightings, which a right lens leaves
    farther off than the wrong one that they were chosen by, hardly count."""
    errors = np.array([model.points3D[number].error for number in sorted(model.points3D)])
    return float(SOFT_PX * np.sqrt(np.log1p((errors / SOFT_PX) ** 2).mean()))


def _adjust(model: Any, photos: PhotoSet, job: Job) -> tuple[Any, int]:
    """Return a model adjusted, and how many points were added for it; the one given is used up."""
    ids = sorted(number for number, image in model.images.items() if image.has_pose)
    shared = _shared(model, ids)
    views, scales = _views(model, photos, ids)
    extra: dict[int, list[FloatArray]] = {number: [] for number in ids}
    tracks: list[Track] = []

    def look(index: int) -> tuple[list[int], FloatArray, FloatArray, NDArray[np.bool_]]:
        near = _neighbours(index, shared, views)
        corners, seen = follow(views[index], [views[k] for k in near])
        sighted = np.concatenate([corners[None], seen])
        return near, sighted, *_triangulate([views[index], *(views[k] for k in near)], sighted)

    for index, (near, sighted, points, good) in enumerate(in_order(look, len(ids))):
        for n in np.flatnonzero(good.sum(axis=0) >= LEAST_VIEWS):
            track = []
            for m in np.flatnonzero(good[:, n]):
                photo = index if m == 0 else near[m - 1]
                extra[ids[photo]].append((sighted[m, n] + 0.5) / scales[photo])
                track.append((ids[photo], len(extra[ids[photo]]) - 1))
            tracks.append((points[n], track))
        job.progress(0.85 + 0.1 * (index + 1) / len(ids), f"adjusting cameras, photo {index + 1} of {len(ids)}")
    fresh = _enter(model, extra, tracks)
    if len(fresh) >= LENS * len(ids):
        model = _as_bent_as_shown(model)
    else:
        solve(model, SOFT_PX, bent=False)
    for number in fresh:
        model.delete_point3D(number)
    return model, len(fresh)


def _enter(model: Any, extra: Mapping[int, list[FloatArray]], tracks: list[Track]) -> list[int]:
    """Add sightings and points to a model, and return the points' numbers. Its own points keep their order.

    COLMAP takes the sightings of a photo all at once only. Features of no point are dropped.
    """
    import pycolmap

    places: dict[int, list[FloatArray]] = {number: list(extra.get(number, [])) for number in model.images}
    own = []
    for number in sorted(model.points3D):
        point, sightings = model.points3D[number], []
        for element in point.track.elements:
            places[element.image_id].append(model.images[element.image_id].point2D(element.point2D_idx).xy)
            sightings.append((element.image_id, len(places[element.image_id]) - 1))
        own.append((np.array(point.xyz), sightings, np.array(point.color)))
    model.delete_all_points2D_and_points3D()
    for number, pixels in places.items():
        model.images[number].points2D = pycolmap.Point2DList([pycolmap.Point2D(xy) for xy in pixels])

    def add(xyz: FloatArray, sightings: list[tuple[int, int]], color: NDArray[np.uint8]) -> int:
        track = pycolmap.Track([pycolmap.TrackElement(photo, place) for photo, place in sightings])
        return int(model.add_point3D(xyz, track, color))

    for xyz, sightings, color in own:
        add(xyz, sightings, color)
    return [add(xyz, sightings, np.zeros(3, np.uint8)) for xyz, sightings in tracks]


def _views(model: Any, photos: PhotoSet, ids: list[int]) -> tuple[list[TrackedPhoto], list[float]]:
    """Return the placed photos, and how much smaller than the files they are."""
    import cv2

    paths = {path.name: path for path in photos.paths}
    shares = _shares(model, paths, ids)
    views, scales = [], []
    for number in ids:
        image = model.images[number]
        camera = model.cameras[image.camera_id]
        lens = lens_of(camera)
        gray: Any = in_grey(read_image(paths[image.name]), shares)
        scale = min(1.0, LONGER_SIDE / max(gray.shape))
        if scale < 1.0:
            size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
            gray, lens = cv2.resize(gray, size, interpolation=cv2.INTER_AREA), lens.resized(*size)
        scale = lens.width / camera.width
        pose = np.eye(4)
        pose[:3] = image.cam_from_world().matrix()
        at = image.get_observation_points2D()
        pixels = np.array([point.xy for point in at]).reshape(-1, 2) * scale - 0.5
        points = np.array([model.points3D[point.point3D_id].xyz for point in at]).reshape(-1, 3)
        views.append(TrackedPhoto(without_light(gray), lens, pose, pixels, points))
        scales.append(scale)
    return views, scales


def _shares(model: Any, paths: Mapping[str, Path], ids: list[int]) -> FloatArray:
    """Return the shares of red, green and blue in which some photos show the places of their points best, (3,)."""

    def shown(number: int) -> tuple[ByteArray, FloatArray]:
        image = model.images[number]
        pixels = np.array([point.xy for point in image.get_observation_points2D()]).reshape(-1, 2) - 0.5
        return read_image(paths[image.name]), pixels

    some = np.unique(np.linspace(0, len(ids) - 1, min(len(ids), COLORED)).round().astype(int))
    return best_shares(shown(ids[k]) for k in some)[0]


def _shared(model: Any, ids: list[int]) -> NDArray[np.int64]:
    """Return how many sparse points each two photos share, shape (C, C)."""
    place = {number: index for index, number in enumerate(ids)}
    shared = np.zeros((len(ids), len(ids)), np.int64)
    for point in model.points3D.values():
        viewers = sorted({place[element.image_id] for element in point.track.elements})
        shared[np.ix_(viewers, viewers)] += 1
    np.fill_diagonal(shared, 0)
    return shared


def _neighbours(index: int, shared: NDArray[np.int64], views: list[TrackedPhoto]) -> list[int]:
    """Return the photos to compare one with: those that share most of its points, from other directions."""
    near: list[int] = []
    middle = np.median(views[index].points, axis=0) if len(views[index].points) else np.zeros(3)
    own = views[index].center - middle
    for other in np.argsort(-shared[index], kind="stable"):
        if shared[index, other] < LEAST_SHARED or len(near) == NEIGHBOURS:
            break
        its = views[other].center - middle
        angle = np.degrees(np.arccos(np.clip(own @ its / np.linalg.norm(own) / np.linalg.norm(its), -1, 1)))
        if NARROWEST_DEG <= angle <= WIDEST_DEG:
            near.append(int(other))
    return near


def _triangulate(views: list[TrackedPhoto], sighted: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the points nearest to the rays of their sightings, and which sightings agree with them.

    Args:
        views: M photos.
        sighted: Where they show N points [px], NaN where they do not, shape (M, N, 2).

    Returns:
        Points (N, 3), and which sightings (M, N) are good; none of a point whose rays are all but parallel.
    """
    count = sighted.shape[1]
    good: NDArray[np.bool_] = np.asarray(np.isfinite(sighted).all(axis=2))
    system, target = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for view, pixels, has in zip(views, sighted, good, strict=True):
        rays = view.rays(pixels[has])
        across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
        system[has] += across
        target[has] += across @ view.center
    sharp = np.linalg.eigvalsh(system)[:, 0] > np.sin(np.radians(NARROWEST_DEG)) ** 2
    points = np.zeros((count, 3))
    points[sharp] = np.linalg.solve(system[sharp], target[sharp][..., None])[..., 0]
    for view, pixels, has in zip(views, sighted, good, strict=True):
        with np.errstate(invalid="ignore"):
            has &= sharp & (np.linalg.norm(view.project(points) - pixels, axis=1) < FAR_OFF_PX)
    return points, good
