"""Colours for figures on a surface, and the legend that explains them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vto_pipeline.model.arrays import ByteArray, FloatArray


@dataclass(frozen=True)
class Ramp:
    """A colour scale; values beyond its ends take the colour of the end.

    Args:
        title: What is shown.
        unit: Its unit.
        values: Rising, at least two.
        colors: sRGB of each value, as #rrggbb.
    """

    title: str
    unit: str
    values: Sequence[float]
    colors: Sequence[str]

    def paint(self, values: FloatArray) -> ByteArray:
        """Return the sRGB colours of values, shape (N,) -> (N, 3)."""
        stops = np.array([_rgb(color) for color in self.colors], dtype=np.float64)
        mixed = [np.interp(values, self.values, stops[:, channel]) for channel in range(3)]
        return np.rint(np.column_stack(mixed)).astype(np.uint8)

    def legend(self) -> dict[str, object]:
        """The scale as plain JSON values for the page."""
        return {
            "title": self.title,
            "unit": self.unit,
            "values": list(self.values),
            "colors": list(self.colors),
        }


@dataclass(frozen=True)
class Key:
    """Named colours.

    Args:
        title: What is shown.
        names: One per colour.
        colors: sRGB, as #rrggbb.
    """

    title: str
    names: Sequence[str]
    colors: Sequence[str]

    def paint(self, which: FloatArray) -> ByteArray:
        """Return the sRGB colours of indices into `names`, shape (N,) -> (N, 3)."""
        return np.array([_rgb(color) for color in self.colors], dtype=np.uint8)[which]

    def legend(self) -> dict[str, object]:
        """The key as plain JSON values for the page."""
        return {"title": self.title, "names": list(self.names), "colors": list(self.colors)}


_COLD_TO_HOT = ("#3b6fb6", "#8fc1d4", "#f2ecc2", "#f09a53", "#b8202c")

STRETCH = Ramp("Stretch beyond rest", "%", (0, 2, 5, 10, 20), _COLD_TO_HOT)
"""Ends at 20 %, blue to red, as CLO's strain map does; finer steps in the range of woven cloth."""

CLEARANCE = Ramp("Distance to the body", "mm", (0, 3, 10, 30, 60), _COLD_TO_HOT[::-1])

SCAN = Key("Scan", ("garment", "mannequin"), ("#4f8f8b", "#b9b5ad"))


def _rgb(color: str) -> tuple[int, int, int]:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)
