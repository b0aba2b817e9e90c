"""Colours of samples from the photos that show them: coarse colours averaged, fine detail from the best photo.

Two bands after Burt and Adelson 1983, on surfaces Allène, Pons and Keriven 2008.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.numerics.resample import bicubic, bilinear

ONE = 64.0
"""Colours are kept as whole numbers, so many to a step of a byte."""


def coarse_band(picture: ByteArray, mask: NDArray[np.uint8], sigma: float) -> NDArray[np.float32]:
    """Return a photo blurred, from some pixels alone, shape (H, W, 3).

    Args:
        picture: Without distortion, shape (H, W, 3).
        mask: 1 for pixels that show nothing but the surface, else 0, shape (H, W).
        sigma: Of the Gaussian [px].
    """
    import cv2

    weight = mask.astype(np.float32)
    share = np.asarray(cv2.GaussianBlur(weight, (0, 0), sigma))
    blurred = np.asarray(cv2.GaussianBlur(picture * weight[..., None], (0, 0), sigma))
    return np.asarray(blurred / np.maximum(share, 1e-4)[..., None], dtype=np.float32)


@njit(cache=True, parallel=True)
def read_colors(  # type: ignore[no-untyped-def]  # typed by Numba
    number, vertices, faces, face, weight, lens, bend, cam_from_world, picture, coarse, best, low, high
):
    """Read a photo's colours at the samples that it was ranked for.

    Args:
        number: Of the photo.
        vertices, faces: The surface.
        face, weight: The samples.
        lens: fx, fy, cx, cy [px].
        bend: Radial distortion k1.
        cam_from_world: Pose, shape (4, 4).
        picture: As taken, shape (H, W, 3).
        coarse: Without distortion, blurred, shape (H, W, 3).
        best: Photos of each sample, shape (N, K).
        low, high: Coarse colour and what the photo has beyond it, in 1 / ONE, shape (N, K, 3); changed.
    """
    fx, fy, cx, cy = lens
    m = cam_from_world
    for n in prange(len(face)):
        for slot in range(best.shape[1]):
            if best[n, slot] != number:
                continue
            px, py, pz = 0.0, 0.0, 0.0
            for k in range(3):
                v, w = faces[face[n], k], weight[n, k]
                px += w * vertices[v, 0]
                py += w * vertices[v, 1]
                pz += w * vertices[v, 2]
            z = m[2, 0] * px + m[2, 1] * py + m[2, 2] * pz + m[2, 3]
            x = (m[0, 0] * px + m[0, 1] * py + m[0, 2] * pz + m[0, 3]) / z
            y = (m[1, 0] * px + m[1, 1] * py + m[1, 2] * pz + m[1, 3]) / z
            bent = 1.0 + bend * (x * x + y * y)
            for c in range(3):
                blurred = bilinear(coarse, fx * x + cx, fy * y + cy, c)
                sharp = bicubic(picture, fx * x * bent + cx, fy * y * bent + cy, c)
                low[n, slot, c] = np.int16(np.rint(ONE * blurred))
                high[n, slot, c] = np.int16(np.rint(ONE * (sharp - blurred)))


@njit(cache=True, parallel=True)
def blend(best, score, low, high, gain, tolerance, sharpness):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return one colour for each sample.

    Photos whose coarse colour is far from the median of all show something else there and are left out. The others'
    coarse colours are averaged by their scores, and fine detail by a high power of them, so that nearly all of it is
    the best photo's, without a line where another becomes the best.

    Args:
        best, score: Photos of each sample and how well they show it, shape (N, K).
        low, high: Their colours, in 1 / ONE, shape (N, K, 3).
        gain: What each photo's colours are multiplied by, shape (C, 3).
        tolerance: Largest difference from the median [steps of a byte], where the photos themselves differ less.
        sharpness: The power.

    Returns:
        Colours 0 to 255, shape (N, 3), and by how many photos each sample is seen, shape (N,).
    """
    count, slots = best.shape
    color, seen = np.zeros((count, 3), np.float32), np.zeros(count, np.uint8)
    for n in prange(count):
        held = 0
        while held < slots and best[n, held] >= 0:
            held += 1
        if held == 0:
            continue
        coarse, far = np.empty((held, 3)), np.zeros(held)
        for k in range(held):
            for c in range(3):
                coarse[k, c] = gain[best[n, k], c] * low[n, k, c] / ONE
        if held > 2:
            for c in range(3):
                middle = np.median(coarse[:, c])
                for k in range(held):
                    far[k] = max(far[k], abs(coarse[k, c] - middle))
        limit = max(tolerance, 3.0 * np.median(far))
        top = 0.0
        for k in range(held):
            if far[k] <= limit:
                top = max(top, score[n, k])
        whole, detail = 0.0, 0.0
        for k in range(held):
            if far[k] > limit:
                continue
            share = score[n, k] / top
            whole += share
            detail += share**sharpness
            seen[n] += 1
        for k in range(held):
            if far[k] > limit:
                continue
            share = score[n, k] / top
            for c in range(3):
                fine = gain[best[n, k], c] * high[n, k, c] / ONE
                color[n, c] += share / whole * coarse[k, c] + share**sharpness / detail * fine
        for c in range(3):
            color[n, c] = min(max(color[n, c], 0.0), 255.0)
    return color, seen


def coarse_logs(best: NDArray[np.int16], low: NDArray[np.int16], photos: int) -> FloatArray:
    """Return the logarithm of each sample's coarse colour in each photo, NaN where there is none, shape (3, C, N)."""
    log = np.full((3, photos, len(best)), np.nan)
    for slot in range(best.shape[1]):
        which = np.flatnonzero((best[:, slot] >= 0) & (low[:, slot] > 8 * ONE).all(axis=1))
        log[:, best[which, slot], which] = np.log(low[which, slot] / ONE).T
    return log
