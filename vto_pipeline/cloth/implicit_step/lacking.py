"""Systems whose matrix lacks a part: conjugate gradients, preconditioned by what of it was factored.

Bending that converges on any mesh joins vertices three triangles apart. Factored with all of that, a matrix takes six
times as long; what stands for it has the pattern of plain hinges and is never off by more than a small factor.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vto_pipeline.model.arrays import FloatArray

_LEFT, _MOST = 0.03, 12  # of the solution, by energy, that may be left; iterations


def complete(
    x: FloatArray,
    right: FloatArray,
    substitute: Callable[[FloatArray], FloatArray],
    lacking: Callable[[FloatArray], FloatArray],
) -> bool:
    """Let x, the solution of P x = right, be that of (P + N) x = right, nearly; return whether P + N is found positive.

    Products with P are not needed: P z = r for what the preconditioner makes of a residual r (Hestenes & Stiefel 1952).

    Args:
        x: Shape (V, 3); changed in place.
        right: Shape (V, 3).
        substitute: Returns P⁻¹ of a residual.
        lacking: Returns N times a move.
    """
    energy, residual = float(np.vdot(x, right)), -lacking(x)
    if energy - float(np.vdot(x, residual)) <= 0.0 < energy:
        return False
    along = substitute(residual)
    size, by_matrix = float(np.vdot(residual, along)), residual.copy()
    for _ in range(_MOST):
        if size <= _LEFT * _LEFT * energy:
            break
        product = by_matrix + lacking(along)
        curvature = float(np.vdot(along, product))
        if curvature <= 0.0:
            return False
        step = size / curvature
        x += step * along
        residual -= step * product
        turned = substitute(residual)
        before, size = size, float(np.vdot(residual, turned))
        along = turned + size / before * along
        by_matrix = residual + size / before * by_matrix
    return True
