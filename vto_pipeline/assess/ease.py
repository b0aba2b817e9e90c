"""Ease: garment girth minus body girth at one level, both along the tape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.assess.section import Section, cut
from vto_pipeline.assess.tape import Tape, lay_tape, plane_axes
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class Ease:
    """What a tape says at one level.

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
    """Measure the ease around the stoutest part of the body that a plane meets.

    Args:
        garment: Draped garment [m].
        rest: Its rest positions [m], shape (V, 3).
        body: The body [m].
        origin: A point of the plane [m], shape (3,).
        normal: Of the plane, shape (3,).
        garment_faces: Only these, shape (F,); for example without sleeves.
        body_faces: Only these, shape (F,); for example without arms.

    Returns:
        The measurement, or None where the plane misses the body or the garment does not surround it.
    """
    inner = max(body_tapes(body, origin, normal, body_faces), key=lambda tape: tape.girth, default=None)
    if inner is None:
        return None
    section = cut(garment, origin, normal, garment_faces)
    around = [(tape, part) for tape, part in _tapes(section, origin, normal) if tape.encloses(inner.center)]
    if not around:
        return None
    outer, part = max(around, key=lambda found: found[0].girth)
    lengths = section.length(part, garment.vertices), section.length(part, rest)
    return Ease(inner.girth, outer.girth, *lengths, section.is_closed(part))


def body_tapes(
    body: TriangleMesh, origin: FloatArray, normal: FloatArray, faces: NDArray[np.bool_] | None = None
) -> list[Tape]:
    """Return a tape around each part of the body that a plane meets: the trunk, an arm.

    Args:
        body: The body [m].
        origin: A point of the plane, and the origin of the tapes' plane coordinates [m], shape (3,).
        normal: Of the plane, shape (3,).
        faces: Only these, shape (F,).
    """
    return [tape for tape, _ in _tapes(cut(body, origin, normal, faces), origin, normal)]


def _tapes(section: Section, origin: FloatArray, normal: FloatArray) -> list[tuple[Tape, NDArray[np.intp]]]:
    flat = (section.points - origin) @ plane_axes(normal).T
    laid = [(lay_tape(flat[part]), part) for part in section.parts()]
    return [(tape, part) for tape, part in laid if tape is not None]
