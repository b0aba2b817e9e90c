"""The openings of a garment, and what they say of its type: two of a skirt, three of trousers, four of a top."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import IntArray
from vto_pipeline.model.mesh import TriangleMesh

_LEVEL = 0.5  # of the garment's height that an opening may reach over


@dataclass(frozen=True)
class Rims:
    """The openings by name.

    Args:
        kind: Of garment: "top", "trousers" or "skirt", as the rules of sizes have it.
        loops: "neck", "hem", "left_cuff", "right_cuff"; "waist", "left_hem", "right_hem"; "waist", "hem" -> vertices
            in order.
    """

    kind: str
    loops: Mapping[str, IntArray]

    def part_of(self, vertices: IntArray) -> str:
        """Return which part of the garment a piece with these vertices is, in words; empty if its place says it."""
        ends = {name for name, loop in self.loops.items() if np.isin(loop, vertices).any()}
        if self.kind == "top":
            return "sleeve" if any("cuff" in end for end in ends) and "hem" not in ends else ""
        return "leg" if self.kind == "trousers" else "skirt"


def rims_of(mesh: TriangleMesh) -> Rims | None:
    """Return the openings of a garment that is worn upright, +Y up; None: their number fits no type.

    Args:
        mesh: One piece of surface.
    """
    loops = sorted(boundary_loops(mesh), key=lambda loop: -float(mesh.vertices[loop, 1].mean()))
    height = float(np.ptp(mesh.vertices[:, 1]))
    if any(np.ptp(mesh.vertices[loop, 1]) > _LEVEL * height for loop in loops):
        return None  # an open front, or a garment that lies
    aside = [float(mesh.vertices[loop, 0].mean()) for loop in loops]
    if len(loops) == 2:
        return Rims("skirt", {"waist": loops[0], "hem": loops[1]})
    if len(loops) == 3:
        right, left = sorted((1, 2), key=lambda k: aside[k])
        return Rims("trousers", {"waist": loops[0], "right_hem": loops[right], "left_hem": loops[left]})
    if len(loops) == 4:
        right, *middle, left = sorted(range(4), key=lambda k: aside[k])
        neck, hem = sorted(middle)
        named = {"neck": neck, "hem": hem, "right_cuff": right, "left_cuff": left}
        return Rims("top", {name: loops[k] for name, k in named.items()})
    return None
