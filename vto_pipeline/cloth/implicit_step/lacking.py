"""Systems whose matrix lacks a part: conjugate gradients, preconditioned by what of it was factored.

Bending that converges on any mesh joins vertices three triangles apart. Factored with all of that, a matrix takes six
times as long; what stands for it has the pattern of plain hinges and is never off by more than a small factor.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.sweep import add_lacking
from vto_pipeline.model.arrays import FloatArray

_LEFT, _MOST = 0.03, 12  # of the solution, by energy, that may be left; iterations


class Buckling(NamedTuple):
    """A direction along which a system is not positive definite.

    Args:
        direction: Shape (V, 3).
        curvature: Of the system along it, zero or less.
    """

    direction: FloatArray
    curvature: float


def complete(
    x: FloatArray,
    right: FloatArray,
    substitute: Callable[[FloatArray], FloatArray],
    lacking: Callable[[FloatArray], FloatArray],
) -> Buckling | None:
    """Let x, the solution of P x = right, be that of (P + N) x = right, nearly.

    Products with P are not needed: P z = r for what the preconditioner makes of a residual r (Hestenes & Stiefel 1952).

    Args:
        x: Shape (V, 3); changed in place.
        right: Shape (V, 3).
        substitute: Returns P⁻¹ of a residual.
        lacking: Returns N times a move.

    Returns:
        Where P + N is found not to be positive definite; x is of no use then.
    """
    energy, residual = float(np.vdot(x, right)), -lacking(x)
    curvature = energy - float(np.vdot(x, residual))
    if curvature <= 0.0 < energy:
        return Buckling(x.copy(), curvature)
    along = substitute(residual)
    size, by_matrix = float(np.vdot(residual, along)), residual.copy()
    for _ in range(_MOST):
        if size <= _LEFT * _LEFT * energy:
            break
        product = by_matrix + lacking(along)
        curvature = float(np.vdot(along, product))
        if curvature <= 0.0:
            return Buckling(along, curvature)
        step = size / curvature
        x += step * along
        residual -= step * product
        turned = substitute(residual)
        before, size = size, float(np.vdot(residual, turned))
        along = turned + size / before * along
        by_matrix = residual + size / before * by_matrix
    return None


def times_lacking(
    constraints: tuple[Any, ...], held: NDArray[np.bool_], y: FloatArray, h: float, move: FloatArray
) -> FloatArray:
    """Return what the matrix at positions y of a step of h [s] lacks, times a move [N], shape (V, 3)."""
    found = np.zeros_like(move)
    add_lacking(y, move, constraints, h, found)
    found[held] = 0.0
    return found
