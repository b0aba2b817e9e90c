"""Camera captures: lists of files and their metadata. `io` reads the pixels, picture by picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, freeze
from vto_pipeline.model.camera import Intrinsics


@dataclass(frozen=True)
class PhotoSet:
    """Photos of one object from many sides.

    Args:
        paths: Image files, sorted by name; at least two.
        intrinsics: Starting guess from EXIF, one per photo; None where EXIF says nothing.
        board: ChArUco board lying in the scene, or None.
    """

    paths: tuple[Path, ...]
    intrinsics: tuple[Intrinsics | None, ...]
    board: CharucoBoard | None = None

    def __post_init__(self) -> None:
        if len(self.paths) < 2:
            raise InputError(f"{len(self.paths)} photo(s); at least 2 are needed")
        if len(self.intrinsics) != len(self.paths):
            raise InputError(f"{len(self.paths)} photos but {len(self.intrinsics)} intrinsics")


@dataclass(frozen=True)
class Video:
    """A video taken on a way round an object.

    Args:
        path: The file.
        width, height: Of its frames [px].
        board: ChArUco board lying in the scene, or None.
    """

    path: Path
    width: int
    height: int
    board: CharucoBoard | None = None


@dataclass(frozen=True)
class CharucoBoard:
    """A printed ChArUco board.

    Args:
        columns, rows: Squares along x and y.
        square_m, marker_m: Side of a chess square and of a marker [m].
        dictionary: OpenCV's name of the marker set.
    """

    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str = "DICT_4X4_250"

    def __post_init__(self) -> None:
        if not (self.columns > 1 and self.rows > 1 and 0 < self.marker_m < self.square_m):
            raise InputError(f"board {self.columns} x {self.rows}, square {self.square_m} m, marker {self.marker_m} m")


@dataclass(frozen=True)
class DepthFrameSet:
    """Frames of a depth camera, in the order they were taken.

    Args:
        depth_paths: 16-bit images, N of them; 0 means no reading.
        color_paths: Colour images, N of them, or empty.
        intrinsics: The depth camera.
        depth_scale: Units of the stored value per metre (1000 for millimetres).
        world_from_cam: Known poses [m], shape (N, 4, 4), or None.
        poses_approximate: Whether those are good to centimetres only, as from a phone's own tracking.
        color_intrinsics: The colour camera, which sits where the depth camera does, or None when each colour pixel
            belongs to the depth pixel with its index.
        confidence_paths: 8-bit images, N of them, 0 where a reading is not to be trusted, or empty.
    """

    depth_paths: tuple[Path, ...]
    color_paths: tuple[Path, ...]
    intrinsics: Intrinsics
    depth_scale: float
    world_from_cam: FloatArray | None = None
    poses_approximate: bool = False
    color_intrinsics: Intrinsics | None = None
    confidence_paths: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.depth_paths)
        if count == 0:
            raise InputError("no depth frames")
        if self.color_paths and len(self.color_paths) != count:
            raise InputError(f"{count} depth frames but {len(self.color_paths)} colour frames")
        if not self.depth_scale > 0:
            raise InputError(f"depth_scale is {self.depth_scale}; expected units per metre, e.g. 1000")
        if self.world_from_cam is not None:
            poses = freeze("world_from_cam", self.world_from_cam, (count, 4, 4), "f8")
            object.__setattr__(self, "world_from_cam", poses)


@dataclass(frozen=True)
class DepthMaps:
    """Depth along the optical axis for each pixel of posed photos, after undistortion (k1 = 0).

    Args:
        names: File names of the photos, C of them.
        intrinsics: Of the depth maps, which may be smaller than the photos; one per photo.
        world_from_cam: Rigid transforms [m], shape (C, 4, 4).
        depth: [m], shape (C, H, W), float32; 0 means none. Smaller photos fill the upper left corner.
    """

    names: tuple[str, ...]
    intrinsics: tuple[Intrinsics, ...]
    world_from_cam: FloatArray
    depth: NDArray[np.float32]

    def __post_init__(self) -> None:
        count = len(self.names)
        if len(self.intrinsics) != count:
            raise InputError(f"{count} depth maps but {len(self.intrinsics)} intrinsics")
        object.__setattr__(self, "world_from_cam", freeze("world_from_cam", self.world_from_cam, (count, 4, 4), "f8"))
        object.__setattr__(self, "depth", freeze("depth maps", self.depth, (count, None, None), "f4"))
        if (self.depth < 0).any():
            raise InputError("depth maps: negative depth; 0 means no reading")


@dataclass(frozen=True)
class Silhouettes:
    """A person photographed from the front and from the side.

    Args:
        front, side: Image files.
        stature: Body height [m].
    """

    front: Path
    side: Path
    stature: float

    def __post_init__(self) -> None:
        if not 0.5 < self.stature < 2.6:
            raise InputError(f"stature is {self.stature} m; expected 0.5 to 2.6 m", hint="is it in centimetres?")
