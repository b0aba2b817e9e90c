"""Quadratic bending of sheets that hardly stretch: Bergou, Wardetzky, Harmon, Zorin & Grinspun 2006, section 3.

With the constant weights K of a hinge on its four vertices, K·x is the mean curvature normal over the hinge: for a
hinge of length l at angle θ it is as long as 2 l sin(θ/2). Energy ½ B |K·x|² / A, for small angles that of
`constraints.bend`. Its matrix is constant. It knows flat rest shapes only, and softens as a hinge folds sharply.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.bending.hinge import solid_hinges
from vto_pipeline.cloth.constraints.points.combination import Combination, combinations
from vto_pipeline.model.fabric import Fabric


def isometric_bend(
    hinges: NDArray[np.int32], rest: NDArray[np.float64], fabric: Fabric, damping: float = 0.0
) -> Combination:
    """Return the bending of a sheet that is flat at rest.

    Args:
        hinges: Ends and wings as from `geometry.topology.hinges`, shape (H, 4).
        rest: Rest positions [m], shape (V, 3).
        fabric: Bending rigidities; see `constraints.bend.bend`.
        damping: Rayleigh's β [s].
    """
    found, _ = solid_hinges(hinges, rest)
    stiffness = found.stiffness(fabric)
    stiff = stiffness > 0.0
    hinges, length, stiffness = found.vertices[stiff], found.length[stiff], stiffness[stiff]
    edge = rest[hinges[:, 1]] - rest[hinges[:, 0]]
    ends = np.zeros((len(hinges), 2))
    wings = np.zeros((len(hinges), 2))
    for k in (0, 1):
        side = rest[hinges[:, 2 + k]] - rest[hinges[:, 0]]
        foot = np.einsum("ij,ij->i", side, edge) / length**2
        wings[:, k] = 1.0 / np.linalg.norm(side - foot[:, None] * edge, axis=1)
        ends -= wings[:, [k]] * np.column_stack([1.0 - foot, foot])
    weights = length[:, None] * np.column_stack([ends, wings])
    return combinations(hinges, weights, None, length**2 / stiffness, rest, damping)
