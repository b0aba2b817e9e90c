"""Background subtraction: one person in front of a plain backdrop, or a drawn silhouette."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_fill_holes, binary_opening, label

from vto_pipeline.errors import AvatarError
from vto_pipeline.model.arrays import ByteArray, FloatArray

_BORDER = 0.03
_MIN_SHARE = 0.3
_CONTRAST = 3.0
_SECOND = 0.25
_TALL = 200
_HINT = "show one whole person in front of a plain backdrop of a different colour"


def segment_person(image: ByteArray, where: str) -> NDArray[np.bool_]:
    """Return where the person is: colours unlike the backdrop's, cut where both classes are tightest (Otsu 1979).

    The backdrop's colour may vary smoothly: a plane through the border's colours is taken off.

    Args:
        image: sRGB, shape (H, W, 3).
        where: The picture's name, for messages.

    Raises:
        AvatarError: nothing stands out, it is cut off by the border, or there is more than one person.
    """
    away = _unlike_backdrop(image)
    threshold = _otsu(away.ravel())
    inside = away > threshold
    if inside.all() or not inside.any() or away[inside].mean() < _CONTRAST * away[~inside].mean():
        raise AvatarError("nothing stands out from the backdrop", where=where, hint=_HINT)
    ball = np.ones((3, 3), dtype=bool)
    parts, count = label(binary_opening(binary_closing(np.pad(inside, 1, mode="edge"), ball), ball)[1:-1, 1:-1])
    if count == 0:
        raise AvatarError("nothing stands out from the backdrop", where=where, hint=_HINT)
    sizes = np.bincount(parts.ravel())[1:]
    largest = 1 + int(np.argmax(sizes))
    mask: NDArray[np.bool_] = binary_fill_holes(parts == largest)
    rows, columns = (np.flatnonzero(mask.any(axis=k)) for k in (1, 0))
    others = [k for k in range(1, count + 1) if k != largest and sizes[k - 1] > _SECOND * sizes[largest - 1]]
    if others:
        raise AvatarError(
            f"{1 + len(others)} objects of a person's size in front of the backdrop", where=where, hint=_HINT
        )
    touched = [
        name
        for name, cut in (
            ("top", rows[0] == 0),
            ("bottom", rows[-1] == len(mask) - 1),
            ("left", columns[0] == 0),
            ("right", columns[-1] == mask.shape[1] - 1),
        )
        if cut
    ]
    if touched:
        raise AvatarError(f"the person is cut off at the picture's {' and '.join(touched)}", where=where, hint=_HINT)
    if len(rows) < _MIN_SHARE * len(mask):
        raise AvatarError(f"the largest object is only {len(rows)} of {len(mask)} pixels tall", where=where, hint=_HINT)
    return mask


def _unlike_backdrop(image: ByteArray) -> FloatArray:
    """Distance of each pixel's colour from the backdrop's, shape (H, W)."""
    picture = image.astype(np.float64)
    height, width = image.shape[:2]
    rim = max(2, int(_BORDER * min(height, width)))
    row, column = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    plane = np.stack([np.ones_like(row), row, column], axis=2)
    border = np.ones((height, width), dtype=bool)
    border[rim:-rim, rim:-rim] = False
    for _ in range(3):  # feet may stand on the border: what is unlike the rest of it is left out
        color = np.linalg.lstsq(plane[border], picture[border], rcond=None)[0]
        away: FloatArray = np.linalg.norm(picture - plane @ color, axis=2)
        border &= away <= 2.5 * np.median(away[border]) + 1.0
    return away


def _otsu(values: FloatArray) -> float:
    counts, edges = np.histogram(values, bins=256)
    centers = (edges[1:] + edges[:-1]) / 2
    low = np.cumsum(counts)
    high = low[-1] - low
    sums = np.cumsum(counts * centers)
    with np.errstate(divide="ignore", invalid="ignore"):
        between = low * high * (sums / low - (sums[-1] - sums) / high) ** 2
    # a picture of one colour is one class: no value parts it in two
    return float(centers[int(np.nanargmax(between))]) if np.isfinite(between).any() else np.inf


def overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Return how much two outlines have in common at equal height, 0 to 1; mirrored where that is more.

    Args:
        one: Whether a pixel is of the person, shape (H, W).
        other: The same of another picture, of any size.
    """
    first, second = _at_equal_height(one), _at_equal_height(other)
    return max(float((first & turned).sum() / (first | turned).sum()) for turned in (second, second[:, ::-1]))


def _at_equal_height(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask cut to the person, 200 pixels tall and 400 wide, the person in the middle."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, tall = rows[0], rows[-1] - rows[0] + 1
    middle = (columns[0] + columns[-1]) / 2.0
    y = top + ((np.arange(_TALL) + 0.5) * tall / _TALL).astype(int)
    x = np.rint(middle + (np.arange(2 * _TALL) - _TALL + 0.5) * tall / _TALL).astype(int)
    inside = (x >= 0) & (x < mask.shape[1])
    found: NDArray[np.bool_] = mask[np.ix_(y, np.clip(x, 0, mask.shape[1] - 1))] & inside
    return found
