"""Photos in the grey in which features are looked for: that in which the print shows best.

Of a print of one brightness, the usual grey shows noise mostly. Features need no levels that follow the light, and are
placed to a pixel only: one channel less another will do, though a lens may bend the two differently.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.scan.grey import best_differences, in_grey

LOOKED_AT = 12
"""Photos that tell it."""


def in_best_grey(photos: PhotoSet, folder: Path, job: Job) -> PhotoSet:
    """Return photos in the grey that shows best what there is to see in them.

    Args:
        photos: In colour.
        folder: New; receives the photos under their own names.
        job: Notified of the grey.

    Returns:
        The photos themselves where the usual grey does about as well.
    """
    import cv2

    count = len(photos.paths)
    some = np.unique(np.linspace(0, count - 1, min(count, LOOKED_AT)).round().astype(int))
    shares, gain = best_differences(read_image(photos.paths[k]) for k in some)
    if gain == 1.0:
        return photos
    red, green, blue = 100.0 * shares
    what = f"{red:.0f} % red, {green:.0f} % green, {blue:.0f} % blue"
    job.note(f"features are looked for in {what}: against noise that shows {gain:.1f} times as much as the usual grey")
    job.measure(feature_grey_shares=[round(float(share), 2) for share in shares], feature_grey_gain=round(gain, 2))
    folder.mkdir()
    for path in photos.paths:
        grey = in_grey(read_image(path), shares)
        cv2.imwrite(str(folder / path.name), grey, [cv2.IMWRITE_JPEG_QUALITY, 98])
    return PhotoSet(tuple(folder / path.name for path in photos.paths), photos.intrinsics, photos.board)
