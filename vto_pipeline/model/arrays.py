"""Checks shared by the model's constructors: shape, finiteness, and no writing after construction."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
ByteArray = NDArray[np.uint8]


def freeze(name: str, values: Any, shape: tuple[int | None, ...], dtype: Any, *, finite: bool = True) -> NDArray[Any]:
    """Return values as a read-only C-order array of the given shape and type.

    Args:
        name: What the array is, for the message.
        values: Anything NumPy can read.
        shape: Expected shape; None stands for any length.
        dtype: Element type.
        finite: Whether NaN and infinity are refused.

    Raises:
        InputError: no numbers, wrong shape, or a value that is not finite.
    """
    try:
        array = np.ascontiguousarray(values, dtype=dtype)
    except (OverflowError, TypeError, ValueError) as e:
        raise InputError(f"{name}: {e}") from None
    if array is values and array.flags.writeable:  # the caller keeps the right to write into their own
        array = array.copy()
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise InputError(f"{name}: shape {array.shape}; expected {wanted}")
    if finite and array.dtype.kind == "f" and not np.isfinite(array).all():
        bad = int(array.size - np.isfinite(array).sum())
        raise InputError(f"{name}: {bad} of {array.size} values are not finite (NaN or infinity)")
    array.flags.writeable = False
    return array
