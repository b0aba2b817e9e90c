"""Bodies of the SMPL family that the user owns: .npz archives of plain arrays, never pickles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays, read_arrays

_NEEDED = ("v_template", "f", "J_regressor", "weights", "kintree_table")
_OPTIONAL = ("shapedirs", "betas")
_MAX_VERTICES, _MAX_JOINTS = 200_000, 500
_HINT = "save v_template, f, J_regressor, weights and kintree_table as dense arrays: numpy.savez, no objects"


def parse_smpl(name: str) -> Arrays:
    """Read a body model's mean shape, or the shape of its `betas` where the archive holds them, at rest.

    Args:
        name: Path of an .npz file with v_template (V, 3) [m], f (F, 3), J_regressor (J, V), weights (V, J),
            kintree_table (2, J) or (J,); shapedirs (V, 3, B) and betas (B,) if there are any (Loper et al. 2015).

    Returns:
        vertices, faces, joints, parents, weights, joint_names.

    Raises:
        FormatError: an array is missing, an object, of the wrong shape, or not finite.
    """
    path = Path(name)
    try:
        arrays = read_arrays(path, only=(*_NEEDED, *_OPTIONAL))
    except FormatError as e:
        raise FormatError(e.problem, where=e.where, hint=_HINT) from None
    missing = [key for key in _NEEDED if key not in arrays]
    if missing:
        problem = f"not a body model: {', '.join(missing)} missing; expected {', '.join(_NEEDED)}"
        raise FormatError(problem, where=name, hint=_HINT)
    for key, array in arrays.items():
        if array.dtype.kind not in "fiu":
            raise FormatError(f"{key} holds {array.dtype}; expected numbers", where=name, hint=_HINT)
    template = arrays["v_template"]
    count, joints = len(template) if template.ndim else 0, arrays["J_regressor"].shape[0]
    if not 4 <= count <= _MAX_VERTICES or not 1 <= joints <= _MAX_JOINTS:
        problem = f"{count} vertices and {joints} joints; at most {_MAX_VERTICES} and {_MAX_JOINTS} are read"
        raise FormatError(problem, where=name)
    for key, shape in (("v_template", (count, 3)), ("J_regressor", (joints, count)), ("weights", (count, joints))):
        _check(arrays[key], shape, key, name)
    _check(arrays["f"], (None, 3), "f", name)
    vertices = template.astype(np.float64)
    if "betas" in arrays and "shapedirs" in arrays:
        betas = np.atleast_1d(arrays["betas"]).ravel()
        _check(arrays["shapedirs"], (count, 3, None), "shapedirs", name)
        if len(betas) > arrays["shapedirs"].shape[2]:
            raise FormatError(f"{len(betas)} betas for {arrays['shapedirs'].shape[2]} shapedirs", where=name)
        vertices += arrays["shapedirs"][:, :, : len(betas)].astype(np.float64) @ betas
    parents = _parents(arrays["kintree_table"], joints, name)
    weights = arrays["weights"].astype(np.float64)
    return {
        "vertices": vertices,
        "faces": arrays["f"].astype(np.int64),
        "joints": arrays["J_regressor"].astype(np.float64) @ vertices,
        "parents": parents,
        "weights": weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12),
        "joint_names": np.array([f"joint_{k}" for k in range(joints)], dtype=np.str_),
    }


def _check(array: NDArray[np.generic], shape: tuple[int | None, ...], key: str, where: str) -> None:
    if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise FormatError(f"{key} has the shape {array.shape}; expected ({wanted})", where=where)
    if not np.isfinite(array.astype(np.float64)).all():
        raise FormatError(f"{key} holds values that are not finite", where=where)


def _parents(table: NDArray[np.generic], joints: int, where: str) -> NDArray[np.int64]:
    """The first row of the table; its root is -1, also where that was stored without a sign."""
    row = np.atleast_2d(table)[0].astype(np.int64)
    row = np.where(row >= 2**31, -1, row)
    if row.shape != (joints,) or (row < -1).any() or (row >= np.arange(joints)).any():
        raise FormatError("kintree_table does not name a parent before each joint", where=where)
    return row
