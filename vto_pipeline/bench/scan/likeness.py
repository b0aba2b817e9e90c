"""How like a photo a drawn picture is, and how visible the seams of a texture are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.optimize import minimize_scalar

from vto_pipeline.geometry.topology import half_edges
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.numerics.srgb import decode_srgb, encode_srgb, srgb_curve

WRONG = 64
"""A pixel is wrong where a channel is off by more [of 255]."""

_STOPS = 4.0  # exposure and white balance are looked for so far up and down

_SIGMA, _TRUNCATE = 1.5, 3.5
"""Gaussian window of 11 pixels, and the constants of Wang et al. 2004, eq. 13."""
_C1, _C2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2

_SMOOTH = 0.8
"""Both pictures are blurred by so many pixels before gradients are taken, so that noise is no sharpness [px]."""


def likeness(photo: ByteArray, picture: ByteArray, where: NDArray[np.bool_]) -> dict[str, float]:
    """Compare two pictures of shape (H, W, 3) at some pixels (H, W).

    Returns:
        psnr_db over all channels, and with the photo's exposure and white balance fitted (psnr_levelled_db); the fit:
        exposure_ev by how many stops, white_balance_ev by how many red or blue differ from green; ssim (Wang et al.
        2004) of the grey pictures; sharpness, the gradient energy as a share of the photo's, fitted too; wrong_share;
        share of the picture's pixels that were compared.
    """
    one, other = photo.astype(float), picture.astype(float)
    gain = fit_gains(photo[where], picture[where])
    levelled = encode_srgb(gain * decode_srgb(picture)).astype(float)
    stops = np.log2(gain)
    gray = [values @ (0.299, 0.587, 0.114) for values in (one, other, levelled)]
    inside = _interior(where)
    energy = [_gradient_energy(gray[k])[inside].sum() for k in (0, 2)]
    return {
        "psnr_db": _psnr((one - other)[where]),
        "psnr_levelled_db": _psnr((one - levelled)[where]),
        "exposure_ev": float(abs(stops[1])),
        "white_balance_ev": float(np.abs(stops[[0, 2]] - stops[1]).max()),
        "ssim": float(_ssim(gray[0], gray[1])[inside].mean()),
        "sharpness": float(energy[1] / energy[0]),
        "wrong_share": float((np.abs(one - other).max(axis=2)[where] > WRONG).mean()),
        "compared_share": float(where.mean()),
    }


def fit_gains(photo: ByteArray, picture: ByteArray) -> FloatArray:
    """Return what multiplies a picture's linear light to come nearest to a photo in sRGB, for each channel, shape (3,).

    Args:
        photo, picture: Pixels, sRGB, shape (N, 3) each.
    """
    light, gains = decode_srgb(np.arange(256).astype(np.uint8)), np.ones(3)
    for channel in range(3):  # a picture has 256 levels, so that sums over each are all that the fit needs
        count = np.bincount(picture[:, channel], minlength=256).astype(float)
        mean = np.bincount(picture[:, channel], photo[:, channel], 256) / np.maximum(count, 1)

        def error(log_gain: float, count: FloatArray = count, mean: FloatArray = mean) -> float:
            level = 255 * srgb_curve(np.minimum(np.exp2(log_gain) * light, 1.0))
            return float((count * (level - mean) ** 2).sum())

        gains[channel] = np.exp2(minimize_scalar(error, bounds=(-_STOPS, _STOPS), method="bounded").x)
    return gains


def seam_steps(textured: TexturedMesh, sample: Callable[[ByteArray, FloatArray], FloatArray]) -> dict[str, float]:
    """Return how far the colours on both sides of the seams differ: median and 95th percentile [of 255].

    Args:
        textured: The mesh and its picture.
        sample: Picture and texture coordinates (N, 2) -> colours (N, 3).
    """
    mesh = textured.mesh
    assert mesh.texture is not None
    ends = np.sort(half_edges(mesh), axis=1)
    order = np.lexsort([ends[:, 1], ends[:, 0]])
    twin = np.flatnonzero((np.diff(ends[order], axis=0) == 0).all(axis=1))
    here, there = order[twin], order[twin + 1]
    start, end = mesh.texture.reshape(-1, 2), np.roll(mesh.texture, -1, axis=1).reshape(-1, 2)
    cut = (start[here] != end[there]).any(axis=1) | (end[here] != start[there]).any(axis=1)
    here, there = here[cut], there[cut]
    if not len(here):
        return {"seam_step_median": 0.0, "seam_step_p95": 0.0}
    sides = []
    for share in (0.25, 0.5, 0.75):
        one = sample(textured.picture, (1 - share) * start[here] + share * end[here])
        other = sample(textured.picture, share * start[there] + (1 - share) * end[there])
        sides.append(np.abs(one - other).max(axis=1))
    step = np.concatenate(sides)
    return {"seam_step_median": float(np.median(step)), "seam_step_p95": float(np.percentile(step, 95))}


def _psnr(difference: FloatArray) -> float:
    return float(10 * np.log10(255.0**2 / np.maximum((difference**2).mean(), 1e-9)))


def _interior(where: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels whose window holds no other, nearly."""
    return np.asarray(gaussian_filter(where.astype(float), _SIGMA, truncate=_TRUNCATE) > 0.99)


def _ssim(one: FloatArray, other: FloatArray) -> FloatArray:
    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(gaussian_filter(values, _SIGMA, truncate=_TRUNCATE))

    a, b = mean(one), mean(other)
    aa, bb, ab = mean(one**2) - a * a, mean(other**2) - b * b, mean(one * other) - a * b
    return (2 * a * b + _C1) * (2 * ab + _C2) / ((a * a + b * b + _C1) * (aa + bb + _C2))


def _gradient_energy(values: FloatArray) -> FloatArray:
    rows, columns = np.gradient(gaussian_filter(values, _SMOOTH))
    return rows**2 + columns**2
