"""Quadratic bending of sheets that hardly stretch: Bergou, Wardetzky, Harmon, Zorin & Grinspun 2006, section 3.

With the constant weights K of a hinge on its four vertices, K·x is the mean curvature normal over the hinge: for a
hinge of length l at angle θ it is as long as 2 l sin(θ/2). Energy ½ B |K·x|² / A, for small angles that of
`constraints.bend`. Its matrix is constant. It knows flat rest shapes only, and softens as a hinge folds sharply.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.constraints.bending.hinge import solid_hinges
from vto_pipeline.cloth.constraints.points.combination import Combination, combinations
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh


def isometric_bend(mesh: TriangleMesh, rest: RestShape, fabric: Fabric, damping: float = 0.0) -> Combination:
    """Return the bending of a sheet that is flat at rest.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Bending rigidities; see `constraints.bend.bend`.
        damping: Rayleigh's β [s].
    """
    found = solid_hinges(mesh, rest)
    stiffness = found.stiffness(fabric)
    stiff = stiffness > 0.0
    length, stiffness = found.length[stiff], stiffness[stiff]
    ends = np.zeros((len(length), 2))
    wings = np.zeros((len(length), 2))
    for k in (0, 1):
        first, second, wing = found.corners[stiff, k].transpose(1, 0, 2)
        edge, side = second - first, wing - first
        foot = np.einsum("ij,ij->i", side, edge) / np.einsum("ij,ij->i", edge, edge)
        wings[:, k] = 1.0 / np.linalg.norm(side - foot[:, None] * edge, axis=1)
        ends -= wings[:, [k]] * np.column_stack([1.0 - foot, foot])
    weights = length[:, None] * np.column_stack([ends, wings])
    return combinations(found.vertices[stiff], weights, None, length**2 / stiffness, rest.positions, damping)
