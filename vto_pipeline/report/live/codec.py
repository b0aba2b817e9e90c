"""Places of vertices as few bytes: on a grid, as changes from frame to frame, deflated.

A message is little-endian: a byte that tells a key (0) from a change (1), the number of the frame (32 bit), and a zlib
stream. A key holds the lowest grid point of each axis (32 bit) and the way up from there of each coordinate. A change
holds the way of each coordinate since the frame with the number before. Ways are of 16 bit: low bytes of all first,
then high ones, which are mostly alike. A place is the grid point times `STEP_M`.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.model.arrays import FloatArray

STEP_M = 0.25e-3
"""Of the grid [m]: places are right to half of it along each axis."""
KEY, CHANGE = 0, 1
_HEAD = struct.Struct("<BI")
_FAST = 1  # zlib's level: three times faster than its usual one, for a tenth more bytes

Grid = NDArray[np.int32]


class Encoded(NamedTuple):
    """A frame on its way.

    Args:
        number: Of the frame.
        grid: Grid points, shape (V, 3).
        before: Those of the frame before; None where there is none, or the way from it is too far.
    """

    number: int
    grid: Grid
    before: Grid | None

    def key(self) -> bytes:
        """Return the message that needs no other."""
        low = self.grid.min(axis=0)
        return _message(KEY, self.number, low.astype("<i4").tobytes(), (self.grid - low).astype("<u2"))

    def change(self) -> bytes:
        """Return the message for who has the frame before; a key where that is shorter or the only way."""
        if self.before is None:
            return self.key()
        return _message(CHANGE, self.number, b"", (self.grid - self.before).astype("<i2"))


class Encoder:
    """Numbers frames and knows the last one."""

    def __init__(self) -> None:
        self._number = -1
        self._grid: Grid | None = None

    def encode(self, places: FloatArray) -> Encoded:
        """Return the next frame.

        Args:
            places: [m], shape (V, 3), V the same in all frames; within 16 m of each other and 500 km of the origin.

        Raises:
            FormatError: they are not.
        """
        steps = places / STEP_M
        if not (np.isfinite(steps).all() and np.abs(steps).max() < 2**31 and np.ptp(steps, axis=0).max() < 2**16 - 2):
            raise FormatError("vertices are not finite, or farther apart than a frame can say")
        grid = np.rint(steps).astype(np.int32)
        near = self._grid is not None and np.abs(grid - self._grid).max() < 2**15
        before, self._grid = (self._grid if near else None), grid
        self._number += 1
        return Encoded(self._number, grid, before)


def decode(message: bytes, last: tuple[int, Grid] | None) -> tuple[int, Grid]:
    """Return the number and the grid points of a frame, shape (V, 3).

    Args:
        message: Of `Encoded`.
        last: What the message before gave; None at first.

    Raises:
        FormatError: it is no message, or a change of another frame than the last.
    """
    try:
        kind, number = _HEAD.unpack_from(message)
        data = zlib.decompress(message[_HEAD.size :])
    except (struct.error, zlib.error):
        raise FormatError("not a frame") from None
    if kind == KEY and len(data) >= 12 and (len(data) - 12) % 6 == 0:
        low, ways = np.frombuffer(data[:12], "<i4"), _joined(data[12:], "<u2")
        return number, (low + ways).astype(np.int32)
    if kind != CHANGE or last is None or number != last[0] + 1 or len(data) != 2 * last[1].size:
        raise FormatError(f"frame {number} is not a key and does not follow the last one")
    return number, (last[1] + _joined(data, "<i2")).astype(np.int32)


def _message(kind: int, number: int, before: bytes, ways: NDArray[np.integer]) -> bytes:
    planes = ways.reshape(-1).view(np.uint8).reshape(-1, 2).T.tobytes()
    return _HEAD.pack(kind, number) + zlib.compress(before + planes, _FAST)


def _joined(planes: bytes, dtype: str) -> NDArray[np.int64]:
    pairs = np.frombuffer(planes, np.uint8).reshape(2, -1).T
    ways: NDArray[np.int64] = np.ascontiguousarray(pairs).view(dtype).reshape(-1, 3).astype(np.int64)
    return ways
