"""Zones where fit is assessed: heights of the trunk, and the garment's openings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.assess.ease import Ease, body_hulls, ease_at
from vto_pipeline.geometry.hull import convex_hull, plane_axes
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_UP = np.array([0.0, 1.0, 0.0])


def ease_at_levels(
    garment: TriangleMesh,
    rest: FloatArray,
    body: TriangleMesh,
    levels: Mapping[str, float],
    garment_faces: NDArray[np.bool_],
    body_faces: NDArray[np.bool_],
) -> dict[str, Ease | None]:
    """Measure the trunk at heights.

    Args:
        garment, rest, body: As in `ease_at`.
        levels: Zone -> height [m], such as {"chest": 1.25}.
        garment_faces, body_faces: Which faces are trunk, shape (F,) and (B,).

    Returns:
        Zone -> ease, None where the garment does not go around the body at that height.
    """
    return {
        zone: ease_at(garment, rest, body, height * _UP, _UP, garment_faces=garment_faces, body_faces=body_faces)
        for zone, height in levels.items()
    }


def ease_at_openings(garment: TriangleMesh, rest: FloatArray, body: TriangleMesh) -> dict[str, Ease]:
    """Measure where the garment ends: neck, hem, cuffs, each in the plane that fits its boundary best.

    Openings are named by where they lie, since a scan does not say what they are: "top opening", "left opening" (the
    wearer's), "bottom opening". Openings the body does not pass through are left out.

    Args:
        garment: Draped garment [m].
        rest: Its rest positions [m], shape (V, 3).
        body: The body [m].
    """
    low, high = garment.vertices.min(axis=0), garment.vertices.max(axis=0)
    measured: dict[str, Ease] = {}
    for loop in boundary_loops(garment):
        points = garment.vertices[loop]
        center = points.mean(axis=0)
        normal = np.cross(points - center, np.roll(points, -1, axis=0) - center).sum(axis=0)  # Newell's
        outer = convex_hull((points - center) @ plane_axes(normal).T) if normal.any() else None
        if outer is None:
            continue
        around = [hull for hull in body_hulls(body, center, normal) if hull.encloses(outer.center)]
        if around:
            inner = max(around, key=lambda hull: hull.perimeter)
            place = (center - 0.5 * (low + high)) / (0.5 * (high - low))
            name = _free_name(f"{_side(place)} opening", measured)
            measured[name] = Ease(inner.perimeter, outer.perimeter, _around(points), _around(rest[loop]), closed=True)
    return measured


def _around(points: FloatArray) -> float:
    """Length of a closed line through points [m], shape (N, 3)."""
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def _side(place: FloatArray) -> str:
    """Name a place of the bounding box, coordinates -1 to 1; +X is the wearer's left."""
    side = "left" if place[0] > 0 else "right"
    if abs(place[0]) > abs(place[1]):
        return side
    height = "top" if place[1] > 0 else "bottom"
    return f"{height} {side}" if abs(place[0]) > 0.3 else height


def _free_name(name: str, taken: Mapping[str, Ease]) -> str:
    used = sum(other == name or other.startswith(f"{name} ") for other in taken)
    return f"{name} {used + 1}" if used else name
