"""Pictures as a lens without distortion would have taken them."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.camera import Intrinsics


def undistorted(picture: ByteArray, camera: Intrinsics) -> ByteArray:
    """Return a picture, shape (H, W, 3), as the same camera without distortion would have taken it; black beyond it."""
    import cv2

    if camera.k1 == 0.0:
        return picture
    return np.asarray(cv2.undistort(picture, camera.matrix, np.array([camera.k1, 0.0, 0.0, 0.0])), dtype=np.uint8)
