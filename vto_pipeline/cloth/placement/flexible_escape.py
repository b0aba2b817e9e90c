"""Motion of a garment's parts, each nearly rigid, to a place where they surround the body's.

Legs that stand wider than those of trousers, or arms lower than sleeves, are not reached by moving the garment as one
piece. So its parts go their own ways: cloth in the body asks to come out (`way_out`), and what it is part of follows as
rigidly as possible (`rigidity`), a sleeve as a whole, bent at the shoulder.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.placement.rigidity import Rigidity
from vto_pipeline.cloth.placement.way_out import WayOut
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_ROUNDS = 30
_STILL = 5e-4  # m: no vertex moves farther in the last round
_HELD = 1e-3  # of the weight of cloth in the body: what nothing asks for stays where it is
_CLEAR = 5e-3  # m: how far outside it is to come, or it would only ever come nearer to the surface


def escape_flexibly(body: TriangleMesh, garment: TriangleMesh) -> FloatArray:
    """Return the garment's vertices after its parts have come out of the body as far as they do [m], shape (V, 3).

    Args:
        body: Oriented outward [m].
        garment: Oriented throughout, outward or inward [m].
    """
    way_out = WayOut(body, garment)
    rigidity = Rigidity(garment)
    x = garment.vertices
    for _ in range(_ROUNDS):
        buried, way, depth = way_out.wanted(x)
        if len(buried) == 0:
            break
        weight = np.full(len(x), _HELD)
        weight[buried] = 1.0
        target = x.copy()
        target[buried] += (depth + _CLEAR)[:, None] * way
        before, x = x, rigidity.follow(x, target, weight)
        if np.abs(x - before).max() < _STILL:
            break
    return x
