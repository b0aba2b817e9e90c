"""How well photos agree on small patches of a surface, moved along their normals."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.scan.photos.rematch.smooth_choice import peak

LEAST_CONTRAST = 1.5
"""Standard deviation of a patch without texture [grey levels]: noise."""


@njit(cache=True, nogil=True)
def correlations(  # type: ignore[no-untyped-def]  # typed by Numba
    points, normals, views, pictures, sizes, matrices, cam_from_world, offsets, radius, spacing, held
):
    """Correlate each patch between one photo and the others, for each offset along its normal.

    The patch is a square in the tangent plane, so that slant and distance do not matter (Furukawa and Ponce 2010). In
    some photos something unknown may stand before it. The one that is held against the others is therefore the one
    that the best of them agree with best.

    Args:
        points, normals: Middle and unit normal of each patch, shapes (P, 3).
        views: Photos of each, -1 for none, shape (P, M).
        pictures: Grey, undistorted, shape (C, H, W), uint8.
        sizes: Height and width of each, shape (C, 2).
        matrices, cam_from_world: Of the cameras, shapes (C, 3, 3) and (C, 4, 4).
        offsets: Tried along the normals [m], shape (O,).
        radius: Half side of a patch, in samples.
        spacing: Of the samples [m].
        held: How many of the others must agree.

    Returns:
        Normalised correlation with each photo, shape (P, O, M), float32; NaN where a photo does not show the patch, or
        shows no texture, and for the photo held against the others. Its column, -1 for none, shape (P,).
    """
    count, side = views.shape[1], 2 * radius + 1
    found = np.full((len(points), len(offsets), count), np.float32(np.nan), dtype=np.float32)
    column = np.full(len(points), -1)
    patch, place = np.empty((count, side * side), np.float32), np.empty((side * side, 2))
    pairs = np.empty((len(offsets), count, count), np.float32)
    seen = np.empty(count, np.bool_)
    for p in range(len(points)):
        if (views[p] >= 0).sum() <= held:
            continue  # too few, whatever they show
        n = normals[p]
        first = np.zeros(3)
        first[np.argmin(np.abs(n))] = 1.0
        across = np.cross(n, first)
        across /= np.sqrt((across * across).sum())
        along = np.cross(n, across)
        pairs[:] = np.nan
        most = -np.inf
        for o in range(len(offsets)):
            middle = points[p] + offsets[o] * n
            for m in range(count):
                seen[m] = views[p, m] >= 0 and _sampled(patch[m], place, views[p, m], middle, across, along, pictures,
                                                        sizes, matrices, cam_from_world, radius, spacing)  # fmt: skip
            for a in range(count):
                for b in range(a + 1, count):
                    if seen[a] and seen[b]:
                        total = _dot(patch[a], patch[b])
                        pairs[o, a, b] = pairs[o, b, a] = total
            for m in range(count):
                agree = best_mean(pairs[o, m], held)
                if agree > most:
                    most, column[p] = agree, m
        if column[p] >= 0:
            found[p] = pairs[:, column[p]]
    return found, column


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _dot(a, b):  # type: ignore[no-untyped-def]  # typed by Numba
    total = np.float32(0)
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@njit(cache=True, nogil=True)
def best_mean(values, held):  # type: ignore[no-untyped-def]  # typed by Numba
    """Mean of the largest `held` values, NaN left out; minus infinity where there are fewer."""
    total, taken = 0.0, 0  # one bit for each value that was counted: no memory is asked for
    for _ in range(held):
        best, at = -np.inf, -1
        for k in range(len(values)):
            if values[k] > best and not taken >> k & 1:
                best, at = values[k], k
        if at < 0:
            return -np.inf
        total += best
        taken |= 1 << at
    return total / held


@njit(cache=True, nogil=True)
def mismatch(found, held):  # type: ignore[no-untyped-def]  # typed by Numba
    """One less the mean correlation of the best `held` photos (P, O); one where there are fewer."""
    costs = np.ones(found.shape[:2], np.float32)
    for p in range(costs.shape[0]):
        for o in range(costs.shape[1]):
            costs[p, o] -= max(best_mean(found[p, o], held), 0.0)
    return costs


@njit(cache=True, nogil=True)
def own_places(found, least):  # type: ignore[no-untyped-def]  # typed by Numba
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


@njit(cache=True, nogil=True)
def _sampled(  # type: ignore[no-untyped-def]  # typed by Numba
    patch, place, view, middle, across, along, pictures, sizes, matrices, cam_from_world, radius, spacing
):
    """Fill the patch with a photo's brightness, mean 0 and length 1; False beyond the photo or without texture.

    What lies between its corners is shown between them. `place` is memory for its samples in the photo, shape (S, 2).
    """
    turn, lens = cam_from_world[view], matrices[view]
    height, width = sizes[view]
    corner, right, down = turn[:3, 3].copy(), np.zeros(3), np.zeros(3)
    for i in range(3):
        for j in range(3):
            corner[i] += turn[i, j] * middle[j]
            right[i] += turn[i, j] * spacing * across[j]
            down[i] += turn[i, j] * spacing * along[j]
    side = 2 * radius + 1
    for i in (-radius, radius):
        for j in (-radius, radius):
            if corner[2] + i * right[2] + j * down[2] <= 0.0:
                return False
    for i in range(side):
        for j in range(side):
            a, b = i - radius, j - radius
            z = corner[2] + a * right[2] + b * down[2]
            place[i * side + j, 0] = lens[0, 0] * (corner[0] + a * right[0] + b * down[0]) / z + lens[0, 2]
            place[i * side + j, 1] = lens[1, 1] * (corner[1] + a * right[1] + b * down[1]) / z + lens[1, 2]
    for k in (0, side - 1, side * (side - 1), side * side - 1):
        if not (0.0 <= place[k, 0] < width - 1 and 0.0 <= place[k, 1] < height - 1):
            return False
    mean = 0.0
    for k in range(side * side):
        u, v = place[k]
        column, row = min(int(u), width - 2), min(int(v), height - 2)  # were it rounded beyond its corners
        s, t = u - column, v - row
        upper = (1 - s) * pictures[view, row, column] + s * pictures[view, row, column + 1]
        lower = (1 - s) * pictures[view, row + 1, column] + s * pictures[view, row + 1, column + 1]
        patch[k] = (1 - t) * upper + t * lower
        mean += patch[k]
    mean /= side * side
    squared = 0.0
    for k in range(side * side):
        patch[k] -= mean
        squared += patch[k] ** 2
    if squared < side * side * LEAST_CONTRAST**2:
        return False
    length = np.sqrt(squared)
    for k in range(side * side):
        patch[k] /= length
    return True
