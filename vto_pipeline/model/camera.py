"""Cameras. Pixel (0, 0) is the centre of the first pixel (OpenCV); +X right, +Y down, +Z forward."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, freeze


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera with one radial coefficient, x_d = x (1 + k1 r²).

    Args:
        width, height: Image size [px].
        fx, fy, cx, cy: Focal lengths and principal point [px].
        k1: Radial distortion of normalized coordinates, dimensionless.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not (self.fx > 0 and self.fy > 0):
            raise InputError(f"camera {self.width} x {self.height} px with focal length {self.fx}, {self.fy} px")
        if not np.isfinite([self.cx, self.cy, self.k1]).all():
            raise InputError("camera: principal point or distortion is not finite")

    @property
    def matrix(self) -> FloatArray:
        """K, shape (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def reduced(self, factor: int) -> Intrinsics:
        """The camera of a picture whose pixels are `factor` times as wide; what does not fill one is cut off."""
        shift = (factor - 1) / 2  # from the centre of the first small pixel to that of the first one
        return replace(
            self,
            width=self.width // factor,
            height=self.height // factor,
            fx=self.fx / factor,
            fy=self.fy / factor,
            cx=(self.cx - shift) / factor,
            cy=(self.cy - shift) / factor,
        )

    def resized(self, width: int, height: int) -> Intrinsics:
        """The same camera with another number of pixels."""
        x, y = width / self.width, height / self.height
        cx, cy = (self.cx + 0.5) * x - 0.5, (self.cy + 0.5) * y - 0.5
        return replace(self, width=width, height=height, fx=self.fx * x, fy=self.fy * y, cx=cx, cy=cy)

    def without_distortion(self) -> Intrinsics:
        """The same camera with a lens that bends nothing."""
        return replace(self, k1=0.0)


@dataclass(frozen=True)
class CameraSet:
    """Posed photos.

    Args:
        names: File names of the registered photos, C of them.
        intrinsics: One per photo.
        world_from_cam: Rigid transforms, translation in metres when `metric`, shape (C, 4, 4).
        metric: Whether lengths are metres (a board or depth fixed the scale) or arbitrary.
        unregistered: File names that got no pose.
        still: Whether one camera that stood still took all photos, before which the object turned.
    """

    names: tuple[str, ...]
    intrinsics: tuple[Intrinsics, ...]
    world_from_cam: FloatArray
    metric: bool = True
    unregistered: tuple[str, ...] = ()
    still: bool = False

    def __post_init__(self) -> None:
        count = len(self.names)
        if len(self.intrinsics) != count:
            raise InputError(f"{count} photos but {len(self.intrinsics)} intrinsics")
        object.__setattr__(self, "world_from_cam", freeze("world_from_cam", self.world_from_cam, (count, 4, 4), "f8"))
