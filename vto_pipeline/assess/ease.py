"""Ease: garment girth minus body girth at one level, both along the tape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.hull import Hull, convex_hull, plane_axes
from vto_pipeline.geometry.section import Section, plane_section
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_SAME = 1.02
"""A part of the body whose girth is larger by more than this has another joined to it."""


@dataclass(frozen=True)
class Ease:
    """Ease at one level.

    Args:
        body_girth: [m].
        garment_girth: [m].
        cloth_length: Length of the garment's curve there, along its folds [m].
        rest_length: Length of the same line in the rest shape [m].
        closed: Whether the garment goes all the way around; an open front does not.
    """

    body_girth: float
    garment_girth: float
    cloth_length: float
    rest_length: float
    closed: bool

    @property
    def ease(self) -> float:
        """[m]."""
        return self.garment_girth - self.body_girth

    @property
    def stretch(self) -> float:
        """How much longer the cloth is than at rest along this line, as a share."""
        return self.cloth_length / self.rest_length - 1.0

    @property
    def pulled(self) -> bool:
        """Whether the garment gets around the body only by being stretched.

        Where it goes all the way around, its cloth at rest is shorter than the body. Where it is open, or an arm goes
        off, its girth bridges a gap: without its stretch it is shorter than the body.
        """
        if self.closed:
            return self.rest_length < self.body_girth
        return self.garment_girth - (self.cloth_length - self.rest_length) < self.body_girth


def ease_at(
    garment: TriangleMesh,
    rest: FloatArray,
    body: TriangleMesh,
    origin: FloatArray,
    normal: FloatArray,
    *,
    garment_faces: NDArray[np.bool_] | None = None,
    body_faces: NDArray[np.bool_] | None = None,
) -> Ease | None:
    """Measure the ease around the largest part of the body that a plane cuts.

    Args:
        garment: Draped garment [m].
        rest: Its rest positions [m], shape (V, 3).
        body: The body [m].
        origin: A point of the plane [m], shape (3,).
        normal: Of the plane, shape (3,).
        garment_faces: Only these, shape (F,); for example without sleeves; all, where a whole line around that part of
            the body holds nothing else. Loose cloth beside the trunk may be nearer to an arm, and is no sleeve.
        body_faces: Only these, shape (F,); for example without arms.

    Returns:
        The measurement, or None where the plane misses the body or the garment does not surround it.
    """
    inner = max(body_hulls(body, origin, normal, body_faces), key=lambda hull: hull.perimeter, default=None)
    if inner is None:
        return None
    section, held = plane_section(garment, origin, normal), body_hulls(body, origin, normal)
    lines = [(hull, part) for hull, part in _hulls(section, origin, normal) if section.is_closed(part)]
    around = [(hull, part) for hull, part in lines if _alone(hull, inner, held)]
    if not around:
        section = plane_section(garment, origin, normal, garment_faces)
        around = [(hull, part) for hull, part in _hulls(section, origin, normal) if hull.encloses(inner.center)]
    if not around:
        return None
    outer, part = max(around, key=lambda found: found[0].perimeter)
    lengths = section.length(part, garment.vertices), section.length(part, rest)
    return Ease(inner.perimeter, outer.perimeter, *lengths, section.is_closed(part))


def _alone(hull: Hull, inner: Hull, parts: list[Hull]) -> bool:
    """Whether a hull holds a part of the body (`inner`), as the plane cuts it off whole, and no other."""
    held = [part for part in parts if hull.encloses(part.center)]
    return len(held) == 1 and held[0].encloses(inner.center) and held[0].perimeter < _SAME * inner.perimeter


def body_hulls(
    body: TriangleMesh, origin: FloatArray, normal: FloatArray, faces: NDArray[np.bool_] | None = None
) -> list[Hull]:
    """Return the hull of each part of the body that a plane meets: the trunk, an arm.

    Args:
        body: The body [m].
        origin: A point of the plane, and the origin of the hulls' plane coordinates [m], shape (3,).
        normal: Of the plane, shape (3,).
        faces: Only these, shape (F,).
    """
    return [hull for hull, _ in _hulls(plane_section(body, origin, normal, faces), origin, normal)]


def _hulls(section: Section, origin: FloatArray, normal: FloatArray) -> list[tuple[Hull, NDArray[np.intp]]]:
    flat = (section.points - origin) @ plane_axes(normal).T
    found = [(convex_hull(flat[part]), part) for part in section.parts()]
    return [(hull, part) for hull, part in found if hull is not None]
