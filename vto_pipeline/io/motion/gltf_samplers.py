"""Values of a glTF animation between its keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vto_pipeline.errors import FormatError
from vto_pipeline.io.gltf.document import GltfDocument
from vto_pipeline.model.arrays import FloatArray

WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}
"""Path of a channel -> numbers of a value; weights of morph targets move no joint."""

Keys = tuple[FloatArray, FloatArray, str]
"""Times [s], shape (K,); values, shape (K, W), or with tangents (K, 3, W); the interpolation."""

_TINY = 1e-6


def read_sampler(document: GltfDocument, sampler: Mapping[str, Any], path: str) -> Keys:
    """Read keys of a channel.

    Args:
        document: The file.
        sampler: Of the animation.
        path: "translation", "rotation" or "scale".

    Returns:
        Times [s], shape (K,); values, shape (K, W), or with tangents (K, 3, W); the interpolation.

    Raises:
        FormatError: times do not rise, values do not fit them, or are not finite.
    """
    where = str(document.path)
    kind = sampler.get("interpolation", "LINEAR")
    times = document.accessor(sampler.get("input")).astype(np.float64)
    values = document.accessor(sampler.get("output")).astype(np.float64)
    if kind not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise FormatError(f"interpolation {kind!r}; expected LINEAR, STEP or CUBICSPLINE", where=where)
    if times.shape[1] != 1 or not np.isfinite(times).all() or (np.diff(times[:, 0]) <= 0).any() or times.min() < 0:
        raise FormatError("an animation's times are not finite and rising from 0", where=where)
    rows = len(times) * (3 if kind == "CUBICSPLINE" else 1)
    if values.shape != (rows, WIDTHS[path]) or not np.isfinite(values).all() or abs(values).max() > 1e7:
        problem = f"a channel of {path} has values of shape {values.shape}; expected ({rows}, {WIDTHS[path]}), finite"
        raise FormatError(problem, where=where)
    if kind == "CUBICSPLINE":
        values = values.reshape(-1, 3, WIDTHS[path])
    lengths = np.linalg.norm(values[:, 1] if kind == "CUBICSPLINE" else values, axis=1)
    if path == "rotation" and (lengths < _TINY).any():
        raise FormatError("a rotation of length 0", where=where)
    return times[:, 0], values, kind


def sample(keys: Keys, path: str, wanted: FloatArray) -> FloatArray:
    """Return values at other times, shape (T, W); before the first key and after the last, theirs.

    glTF 2.0, appendix C: slerp for linear rotations; cubic Hermite splines whose tangents are per second.

    Args:
        keys: Times, values and interpolation, as `read_sampler` gives them.
        path: What is animated.
        wanted: Times [s], shape (T,).
    """
    times, values, kind = keys
    wanted = np.clip(wanted, times[0], times[-1])
    middle = values[:, 1] if kind == "CUBICSPLINE" else values
    if len(times) == 1:
        found = np.repeat(middle, len(wanted), axis=0)
    elif kind == "STEP":
        found = middle[np.searchsorted(times, wanted, side="right") - 1]
    elif kind == "CUBICSPLINE":
        found = _hermite(times, values, wanted)
    elif path == "rotation":
        found = Slerp(times, Rotation.from_quat(middle))(wanted).as_quat()
    else:
        found = np.column_stack([np.interp(wanted, times, column) for column in middle.T])
    if path == "rotation":
        found = found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), _TINY)
    return found


def _hermite(times: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    k = np.clip(np.searchsorted(times, wanted, side="right") - 1, 0, len(times) - 2)
    span = (times[k + 1] - times[k])[:, None]
    s = (wanted - times[k])[:, None] / span
    leave, arrive = values[k, 2], values[k + 1, 0]
    mixed: FloatArray = (
        (2 * s**3 - 3 * s**2 + 1) * values[k, 1]
        + span * (s**3 - 2 * s**2 + s) * leave
        + (3 * s**2 - 2 * s**3) * values[k + 1, 1]
        + span * (s**3 - s**2) * arrive
    )
    return mixed
