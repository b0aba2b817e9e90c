"""Positions whose edges have given lengths: the embedding nearest to where they are now.

Levenberg-Marquardt on the squared errors of the lengths (Nocedal & Wright 2006, 10.3). A surface has about as many
edges as coordinates, so lengths that vary smoothly can be met almost exactly.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, eye_array

from vto_pipeline.cloth.equilibrium import factorise
from vto_pipeline.model.arrays import FloatArray, IntArray

_ROUNDS = 12
_HOLD = 1e-4  # weight of staying in place against the lengths: what the lengths leave open does not drift
_MET = 1e-5  # rms of relative errors that is not worth another round


def realise(positions: FloatArray, pairs: IntArray, lengths: FloatArray) -> FloatArray:
    """Return positions near the given ones whose edges are as long as wanted, in the sense of least squares.

    Args:
        positions: Where the search begins [m], shape (V, 3).
        pairs: Ends of the edges, shape (E, 2).
        lengths: Wanted [m], shape (E,).
    """
    count = len(positions)
    weight = 1.0 / lengths
    hold = _HOLD * float(np.median(weight)) ** 2 * eye_array(3 * count, format="csc")
    rows = np.repeat(np.arange(len(pairs)), 6)
    columns = (3 * pairs[:, :, None] + np.arange(3)).reshape(-1)
    x = positions.copy()
    for _ in range(_ROUNDS):
        along = x[pairs[:, 1]] - x[pairs[:, 0]]
        now = np.linalg.norm(along, axis=1)
        wrong = weight * (now - lengths)
        if np.sqrt(np.mean(wrong**2)) < _MET:
            break
        unit = (weight / now)[:, None] * along
        slope = csr_array((np.hstack([-unit, unit]).ravel(), (rows, columns)), shape=(len(pairs), 3 * count))
        x += factorise((slope.T @ slope + hold).tocsc())[0].solve(-(slope.T @ wrong)).reshape(-1, 3)
    return x
