"""cameras.json, and archives of sparse reconstructions and depth maps."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import read_arrays, write_arrays
from vto_pipeline.io.documents import read_json, write_json
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.mesh import PointCloud

_INTRINSICS = ("width", "height", "fx", "fy", "cx", "cy", "k1")


def write_cameras(path: Path, cameras: CameraSet) -> None:
    """Write cameras.json: one record per photo."""
    write_json(path, _record(cameras))


def read_cameras(path: Path) -> CameraSet:
    """Read cameras.json.

    Raises:
        FormatError: a field is missing or of another kind.
    """
    return _cameras(read_json(path), path)


def write_sparse(path: Path, value: tuple[CameraSet, PointCloud]) -> None:
    """Write cameras and points of an unknown scale."""
    cameras, points = value
    normals = np.empty((0, 3)) if points.normals is None else points.normals
    colors = np.empty((0, 3), np.uint8) if points.colors is None else points.colors
    write_arrays(path, {**pack_cameras(cameras), "points": points.points, "normals": normals, "colors": colors})


def read_sparse(path: Path) -> tuple[CameraSet, PointCloud]:
    """Read cameras and points of an unknown scale.

    Raises:
        FormatError: not what `write_sparse` wrote.
    """
    arrays = read_arrays(path, required=("points", "normals", "colors"))
    normals, colors = (arrays[name] if len(arrays[name]) else None for name in ("normals", "colors"))
    return unpack_cameras(arrays), PointCloud(arrays["points"], normals, colors)


def write_depth_maps(path: Path, maps: DepthMaps) -> None:
    """Write depth_maps.npz, compressed: most of a depth map is empty."""
    cameras = CameraSet(maps.names, maps.intrinsics, maps.world_from_cam)
    write_arrays(path, {**pack_cameras(cameras), "depth": maps.depth}, compress=True)


def read_depth_maps(path: Path) -> DepthMaps:
    """Read depth_maps.npz.

    Raises:
        FormatError: not what `write_depth_maps` wrote.
    """
    arrays = read_arrays(path, required=("depth",))
    cameras = unpack_cameras(arrays)
    return DepthMaps(cameras.names, cameras.intrinsics, cameras.world_from_cam, arrays["depth"])


def write_trajectory(path: Path, world_from_cam: FloatArray) -> None:
    """Write poses (N, 4, 4) in the layout of a depth folder's poses.json; NaN, where there is none, as null."""
    stored = world_from_cam.astype(object)
    stored[np.isnan(world_from_cam)] = None
    write_json(path, {"world_from_cam": stored})


def read_trajectory(path: Path) -> FloatArray:
    """Read poses (N, 4, 4); NaN where there is none.

    Raises:
        FormatError: not what `write_trajectory` wrote.
    """
    return _transforms(path, "world_from_cam")


def read_placement(path: Path) -> FloatArray:
    """Read mannequin_from_surface, shape (4, 4).

    Raises:
        FormatError: there is none, or of another shape.
    """
    return read_transform(path, "mannequin_from_surface")


def read_transform(path: Path, key: str) -> FloatArray:
    """Read one transform of a JSON object, shape (4, 4).

    Raises:
        FormatError: there is none, or of another shape.
    """
    found = _transforms(path, key)
    if len(found) != 1:
        raise FormatError(f"{len(found)} transforms; expected one", where=str(path))
    return found[0]


def _transforms(path: Path, key: str) -> FloatArray:
    """Transforms (N, 4, 4) of a JSON object."""
    try:
        found = np.array(read_json(path)[key], dtype=np.float64)
    except (KeyError, OverflowError, TypeError, ValueError) as e:
        raise FormatError(f"no array of numbers under {key!r}: {e}", where=str(path)) from None
    if not found.size or found.size % 16:
        raise FormatError(f"{key} has shape {found.shape}; expected (N, 4, 4)", where=str(path))
    return found.reshape(-1, 4, 4)


def pack_cameras(cameras: CameraSet) -> dict[str, Any]:
    """Pack cameras into arrays."""
    return {
        "names": np.array(cameras.names, dtype=np.str_),
        "unregistered": np.array(cameras.unregistered, dtype=np.str_),
        "metric": np.bool_(cameras.metric),
        "still": np.bool_(cameras.still),
        "intrinsics": np.array([[getattr(i, key) for key in _INTRINSICS] for i in cameras.intrinsics]).reshape(-1, 7),
        "world_from_cam": cameras.world_from_cam,
    }


def unpack_cameras(arrays: dict[str, Any]) -> CameraSet:
    """Unpack cameras from the arrays of `pack_cameras`.

    Raises:
        FormatError: an array is missing or of another shape.
    """
    try:
        return CameraSet(
            names=tuple(map(str, arrays["names"])),
            intrinsics=tuple(Intrinsics(int(w), int(h), *map(float, rest)) for w, h, *rest in arrays["intrinsics"]),
            world_from_cam=arrays["world_from_cam"],
            metric=bool(arrays["metric"]),
            unregistered=tuple(map(str, arrays["unregistered"])),
            still=bool(arrays.get("still", False)),
        )
    except (KeyError, OverflowError, TypeError, ValueError) as e:
        raise FormatError(f"not a list of cameras: {e!r}") from None


def _record(cameras: CameraSet) -> dict[str, Any]:
    photos = [
        {"name": name, "intrinsics": asdict(intrinsics), "world_from_cam": pose}
        for name, intrinsics, pose in zip(cameras.names, cameras.intrinsics, cameras.world_from_cam, strict=True)
    ]
    told = {"metric": cameras.metric, "unregistered": cameras.unregistered, "still": cameras.still}
    return {**told, "photos": photos}


def _cameras(record: Any, path: Path) -> CameraSet:
    try:
        photos = record["photos"]
        return CameraSet(
            names=tuple(str(p["name"]) for p in photos),
            intrinsics=tuple(Intrinsics(**p["intrinsics"]) for p in photos),
            world_from_cam=np.array([p["world_from_cam"] for p in photos], dtype=np.float64).reshape(-1, 4, 4),
            metric=bool(record["metric"]),
            unregistered=tuple(map(str, record["unregistered"])),
            still=bool(record.get("still", False)),
        )
    except (KeyError, OverflowError, TypeError, ValueError) as e:
        raise FormatError(f"not a list of cameras: {e!r}", where=str(path)) from None
