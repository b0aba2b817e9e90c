"""The avatar's archive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays, read_arrays, write_arrays
from vto_pipeline.io.files import check_file
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.body import Avatar, LifelikeBody

_LIMIT_BYTES = 200_000_000
_ARRAYS = ("bind_vertices", "faces", "joints", "parents", "weights", "pose", "translation", "vertices")


def write_avatar(path: Path, avatar: Avatar) -> None:
    """Write an avatar as an archive of plain arrays."""
    write_arrays(path, _arrays(avatar))


def write_lifelike(path: Path, body: LifelikeBody) -> None:
    """Write a lifelike body: an avatar's archive with its colours."""
    write_arrays(path, {**_arrays(body.avatar), "colors": body.colors})


def read_lifelike(path: Path) -> LifelikeBody:
    """Read a lifelike body that `write_lifelike` wrote.

    Raises:
        InputError: no such file; FormatError: no lifelike body.
    """
    arrays = read_arrays(path)
    if "colors" not in arrays:
        raise FormatError("an avatar without colours; expected a lifelike body", where=str(path))
    return LifelikeBody(_avatar(arrays, path), arrays["colors"])


def _arrays(avatar: Avatar) -> Arrays:
    loops = [np.asarray(loop, dtype=np.int32) for loop in avatar.loops.values()]
    return {
        **{name: getattr(avatar, name) for name in _ARRAYS},
        "joint_names": _strings(avatar.joint_names),
        "sex": np.float64(avatar.sex),
        "landmark_names": _strings(avatar.landmarks),
        "landmark_vertices": np.array(list(avatar.landmarks.values()), dtype=np.int32),
        "loop_names": _strings(avatar.loops),
        "loop_lengths": np.array([len(loop) for loop in loops], dtype=np.int32),
        "loop_vertices": np.concatenate([np.empty(0, np.int32), *loops]),
        "parameter_names": _strings(avatar.parameters),
        "parameter_values": np.array(list(avatar.parameters.values()), dtype=np.float64),
        "sigma_names": _strings(avatar.sigmas),
        "sigma_values": np.array(list(avatar.sigmas.values()), dtype=np.float64),
        "caveats": _strings(avatar.caveats),
    }


def read_avatar(path: Path) -> Avatar:
    """Read an avatar that `write_avatar` wrote.

    Raises:
        InputError: no such file; FormatError: no avatar.
    """
    return _avatar(read_arrays(path), path)


def receive_avatar(path: Path) -> Avatar:
    """Read an avatar of unknown origin: unpacked in a limited child process.

    Raises:
        InputError: no such file; FormatError: no avatar.
    """
    path = check_file(Path(path), {".npz"}, _LIMIT_BYTES)
    return _avatar(run_limited(unpack, str(path.resolve()), where=str(path)), path)


def unpack(name: str) -> Arrays:
    """Read the arrays of an archive; runs in the child process."""
    return read_arrays(Path(name))


def _avatar(arrays: Arrays, path: Path) -> Avatar:
    try:
        vertices, faces = arrays["vertices"], arrays["faces"]
        used = np.concatenate([faces.ravel(), arrays["landmark_vertices"], arrays["loop_vertices"]])
        if used.dtype.kind != "i" or used.min() < 0 or used.max() >= len(vertices):
            raise FormatError(f"an index is outside 0..{len(vertices) - 1}", where=str(path))
        loops = np.split(arrays["loop_vertices"], np.cumsum(arrays["loop_lengths"])[:-1])
        return Avatar(
            **{name: arrays[name] for name in _ARRAYS},
            joint_names=tuple(map(str, arrays["joint_names"])),
            sex=float(arrays["sex"]),
            landmarks=dict(zip(map(str, arrays["landmark_names"]), map(int, arrays["landmark_vertices"]), strict=True)),
            loops=dict(zip(map(str, arrays["loop_names"]), loops[: len(arrays["loop_names"])], strict=True)),
            parameters=_named(arrays, "parameter"),
            sigmas=_named(arrays, "sigma") if "sigma_names" in arrays else {},
            caveats=tuple(map(str, arrays.get("caveats", ()))),
        )
    except (KeyError, TypeError, ValueError) as e:
        raise FormatError(f"not an avatar: {e!r}", where=str(path)) from None


def _named(arrays: Arrays, kind: str) -> dict[str, float]:
    return dict(zip(map(str, arrays[f"{kind}_names"]), map(float, arrays[f"{kind}_values"]), strict=True))


def _strings(values: Any) -> np.ndarray:
    return np.array(list(values), dtype=np.str_)
