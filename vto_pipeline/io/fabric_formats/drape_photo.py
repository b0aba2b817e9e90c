"""Photos of a drape test from above: the area of what stands out against the background, the cloth or the bare disc."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.io.captures.images import read_image

_TWO_TONES = 0.8
"""Least share of the brightness's variance that lies between two tones (Otsu 1979); an even slope has 0.75."""
_LEAST_PX = 20_000
"""Below this area [px²], its rim is too large a part of it: an error of half a pixel is then more than 1 %."""
_OTHER = 0.05
"""Largest share of the area that another thing in the picture may have."""


def read_shadow_area(path: Path) -> float:
    """Return the area of the one thing in a photo that differs from the background [px²]; holes in it count as its own.

    Args:
        path: PNG, JPEG or TIFF, taken plumb from above. Light from behind or a shadow on white paper are best.

    Raises:
        InputError: no such file, or not one thing on an even background, whole in the picture.
        FormatError: no picture.
    """
    import cv2

    gray = cv2.medianBlur(cv2.cvtColor(read_image(Path(path)), cv2.COLOR_RGB2GRAY), 5)
    level, bright = cv2.threshold(gray, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    _check_tones(gray, level, path)
    border = np.concatenate([bright[0], bright[-1], bright[:, 0], bright[:, -1]]) > 0
    thing = (bright > 0) != (border.mean() > 0.5)
    count, _, figures, _ = cv2.connectedComponentsWithStats(thing.astype(np.uint8), connectivity=4)
    areas = figures[1:, cv2.CC_STAT_AREA]
    if count < 2 or areas.max() < _LEAST_PX:
        raise InputError(f"no shadow of {_LEAST_PX} pixels or more", where=str(path), hint="take it larger")
    largest = int(np.argmax(areas))
    others = np.delete(areas, largest)
    if others.max(initial=0) > _OTHER * areas[largest]:
        raise InputError("more than one thing stands out", where=str(path), hint="clear the background, or crop to it")
    left, top, wide, high = figures[largest + 1, :4]
    if left == 0 or top == 0 or left + wide == gray.shape[1] or top + high == gray.shape[0]:
        raise InputError("the shadow touches the picture's edge", where=str(path), hint="show it whole, with a margin")
    outlines, _ = cv2.findContours(thing.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(gray.shape, np.uint8)
    cv2.drawContours(filled, [max(outlines, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return float(filled.sum())


def _check_tones(gray: NDArray[Any], level: float, path: Path) -> None:
    """Refuse a picture that is not of two tones."""
    dark = gray <= level
    share = float(dark.mean())
    if 0.0 < share < 1.0:
        between = share * (1.0 - share) * (float(gray[dark].mean()) - float(gray[~dark].mean())) ** 2
        if between > _TWO_TONES * float(gray.var()):
            return
    raise InputError(
        "the shadow does not stand out from the background", where=str(path), hint="light it evenly, on or before white"
    )
