"""Garments from a scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray, freeze
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.notebook import Presented


@dataclass(frozen=True)
class SurfaceLabels:
    """Labels of the vertices of a scanned surface.

    Args:
        garment: Part of the garment, shape (V,), bool.
        confidence: Of `garment`, 0 to 1, shape (V,).
    """

    garment: NDArray[np.bool_]
    confidence: FloatArray

    def __post_init__(self) -> None:
        count = len(self.garment)
        object.__setattr__(self, "garment", freeze("labels garment", self.garment, (count,), "?"))
        object.__setattr__(self, "confidence", freeze("labels confidence", self.confidence, (count,), "f8"))


@dataclass(frozen=True)
class Opening:
    """A real opening of a garment: neck, hem, cuff.

    Args:
        loop: Boundary vertices in order, shape (L,).
        perimeter: [m].
        center: [m], shape (3,).
        normal: Out of the garment, unit, shape (3,).
    """

    loop: IntArray
    perimeter: float
    center: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class RestShape:
    """The shape of the cloth without forces.

    Args:
        positions: Positions of the simulation mesh [m], shape (V, 3). Edge lengths and areas are taken from them unless
            there are panels; then they only say where the garment lay when it was given, smooth and clear of itself.
        rest_angles: Dihedral rest angles are those of `positions` where True, else flat.
        mode: How it was found: "as_scanned", "gravity_removed", "inverse", "panels".
        regraded: Whether it was made anew in proportion to another body, so that a drape tells how the garment would
            look in that size, not whether it fits.
        panels: Corners of each face in the plane [m], v along the warp, shape (F, 3, 2); each face for itself, so that
            a vertex on a seam lies in two panels. None: `positions` are the shape.
    """

    positions: FloatArray
    rest_angles: bool = False
    mode: str = "as_scanned"
    regraded: bool = False
    panels: FloatArray | None = None

    @property
    def worn_as(self) -> str:
        """The question a drape answers: "same_garment" (does it fit) or "regraded" (how would it look)."""
        return "regraded" if self.regraded else "same_garment"

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", freeze("rest positions", self.positions, (None, 3), "f8"))
        if self.panels is not None:
            object.__setattr__(self, "panels", freeze("panels", self.panels, (None, 3, 2), "f8"))

    def corners(self, faces: IntArray) -> FloatArray:
        """Return the corners of each face at rest [m], shape (F, 3, 3): lengths, areas and yarns are taken from them.

        Args:
            faces: Those of the garment's mesh, all of them and in their order, shape (F, 3).

        Raises:
            InputError: as many panels as faces are needed.
        """
        if self.panels is None:
            return np.asarray(self.positions[faces])
        if len(self.panels) != len(faces):
            raise InputError(f"rest shape has panels of {len(self.panels)} faces, the mesh {len(faces)}")
        return np.concatenate([self.panels, np.zeros((len(faces), 3, 1))], axis=2)


@dataclass(frozen=True)
class Garment(Presented):
    """A garment ready to simulate.

    Args:
        mesh: Simulation mesh where it is now [m].
        rest: Its rest shape.
        laid_out: Whether it stands as a pattern's file has it, upright about a body that is not known.
        worn: Whether that is where it was worn, on a body in the same room.
    """

    mesh: TriangleMesh
    rest: RestShape
    laid_out: bool = False
    worn: bool = False
