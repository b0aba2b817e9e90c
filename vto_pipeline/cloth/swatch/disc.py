"""The drape test of Cusick: a disc of cloth, held between two smaller discs, hangs over their edge.

The drape coefficient is the share of the overhanging ring that lies in the shadow from above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.cloth.model.build import ClothModel, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.rest.equilibrium import EquilibriumConfig, equilibrium
from vto_pipeline.cloth.swatch.meshes import MeshKind, disc
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_PIXEL = 2.5e-4  # of the shadow [m]
_UNEVENNESS = 1e-3  # of the start, of the specimen's radius: where the folds come from
_COARSEST, _FINEST = 0.015, 0.004  # edges [m]: the ring needs a few rows, and below nothing changes that is measured
_OF_LENGTH = 0.75  # edge to bending length: with longer ones the folds of limp cloth are held up by its triangles


@dataclass(frozen=True)
class DrapeTest:
    """The sizes of a drape test; as they are, those of BS 5058 and ISO 9073-9 for cloth that is neither limp nor stiff.

    Args:
        radius: Of the specimen [m].
        support: Of the disc that it lies on [m].
    """

    radius: float = 0.15
    support: float = 0.09

    def coefficient(self, shadow: float) -> float:
        """Return the drape coefficient, a share, of a shadow's area [m²]."""
        inner = np.pi * self.support**2
        return float((shadow - inner) / (np.pi * self.radius**2 - inner))


def resolving_edge(rigidity: float, areal_density: float) -> float:
    """Return the edge of a mesh that shows a fabric's folds [m].

    Their size is the bending length (B / w)^(1/3) of Peirce 1930, "The handle of cloth as a measurable quantity".

    Args:
        rigidity: B [N·m].
        areal_density: [kg/m²].
    """
    length = (rigidity / (areal_density * GRAVITY)) ** (1.0 / 3.0)
    return float(np.clip(_OF_LENGTH * length, _FINEST, _COARSEST))


@dataclass(frozen=True)
class Specimen:
    """A disc of cloth over its support.

    Args:
        model: The cloth.
        start: Nearly flat [m], shape (V, 3).
        test: Its sizes.
    """

    model: ClothModel
    start: FloatArray
    test: DrapeTest


def specimen(
    fabric: Fabric,
    test: DrapeTest,
    kind: MeshKind,
    edge: float,
    *,
    bending: str = "shape_operator",
    hysteresis: bool = False,
    seed: int = 0,
) -> Specimen:
    """Return a disc of this fabric.

    Args:
        fabric: What it is made of.
        test: Its sizes.
        kind: Of mesh.
        edge: [m].
        bending: A model of `Materials`.
        hysteresis: With internal friction.
        seed: Of the unevenness it starts with, and of an irregular mesh.
    """
    radius, support = test.radius, test.support
    points, faces = disc(kind, radius, edge, support, seed)
    flat = np.column_stack([points[:, 0], np.zeros(len(points)), -points[:, 1]])
    away = np.linalg.norm(points, axis=1)
    held = np.flatnonzero(away < support * (1.0 + 1e-9))
    model = build_cloth(
        TriangleMesh(flat, faces),
        RestShape(flat),
        fabric,
        pinned=held,
        materials=checked(Materials, {"bending": bending, "hysteresis": hysteresis}),
    )
    start = flat.copy()
    rise = np.clip((away - support) / (radius - support), 0.0, 1.0)
    angle, rng = np.arctan2(points[:, 1], points[:, 0]), np.random.default_rng(seed)
    for waves in range(2, 13):  # smooth, of no preferred number
        start[:, 1] += _UNEVENNESS * radius * rise**2 * rng.normal() * np.cos(waves * angle + rng.uniform(0, 2 * np.pi))
    return Specimen(model, start, test)


def drape_coefficient(positions: FloatArray, faces: IntArray, test: DrapeTest) -> float:
    """Return (shadow - disc) / (specimen - disc), with the shadow of a cloth from above, on a raster.

    Args:
        positions: [m], shape (V, 3), the axis of the disc plumb through the origin.
        faces: Shape (F, 3).
        test: Sizes of specimen and disc.
    """
    count = int(np.ceil(2.2 * test.radius / _PIXEL))
    shade = np.zeros((count, count), dtype=bool)
    corners = positions[faces][:, :, [0, 2]] / _PIXEL + 0.5 * count
    for (ax, ay), (bx, by), (cx, cy) in corners:
        turn = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if turn == 0.0:
            continue
        x0, x1 = int(max(0, np.floor(min(ax, bx, cx)))), int(min(count, np.ceil(max(ax, bx, cx)) + 1))
        y0, y1 = int(max(0, np.floor(min(ay, by, cy)))), int(min(count, np.ceil(max(ay, by, cy)) + 1))
        x, y = np.arange(x0, x1)[:, None] + 0.5, np.arange(y0, y1)[None, :] + 0.5
        u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / turn
        v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / turn
        shade[x0:x1, y0:y1] |= (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    return test.coefficient(shade.sum() * _PIXEL**2)


def at_minimum(one: Specimen) -> FloatArray:
    """Return the positions in the minimum of energy that Newton finds [m], shape (V, 3)."""
    limits = EquilibriumConfig(tolerance=1e-6, iterations=2000)
    return equilibrium(one.model, one.start, limits).positions
