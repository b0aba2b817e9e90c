"""What stands in a room beside a body: pieces of a scan that nothing holds to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import component_areas
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

APART = 0.06
"""A piece stands apart where all of it is farther than this from the body [m]: what is worn comes nearer somewhere."""
FURNITURE = 0.25
"""It has less than this share of the largest piece's area: another person has more, and who is meant is not guessed."""


def faces_apart(scan: TriangleMesh, away: FloatArray) -> NDArray[np.bool_]:
    """Return which faces belong to pieces that stand apart from a body, shape (F,).

    Args:
        scan: In pieces [m].
        away: How far its vertices are from the body, not negative [m], shape (V,).
    """
    piece, area = component_areas(scan)
    nearest = np.full(len(area), np.inf)
    np.minimum.at(nearest, piece, away[scan.faces].min(axis=1))
    return np.asarray(((area < FURNITURE * area.max()) & (nearest > APART))[piece])
