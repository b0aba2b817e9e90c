"""Constraint solvers: each takes a model and advances a state subject to contacts.

newton: backward Euler with contacts inside the system; the default
xpbd, pbd_soft, gauss_seidel, jacobi, dual_descent, chebyshev, anderson, conjugate_residual: position based
fast_projection, projective, vertex_descent: Newton on multipliers, a constant matrix, vertex by vertex
"""

from __future__ import annotations

from vto_pipeline.cloth.implicit_step.iterated import Iterated
from vto_pipeline.cloth.solvers.anderson import Anderson
from vto_pipeline.cloth.solvers.chebyshev import Chebyshev
from vto_pipeline.cloth.solvers.conjugate_residual import ConjugateResidual
from vto_pipeline.cloth.solvers.fast_projection import FastProjection
from vto_pipeline.cloth.solvers.gauss_seidel import GaussSeidel
from vto_pipeline.cloth.solvers.jacobi import Jacobi, PlainJacobi
from vto_pipeline.cloth.solvers.newton import Newton
from vto_pipeline.cloth.solvers.pbd_soft import PbdSoft
from vto_pipeline.cloth.solvers.projective import Projective
from vto_pipeline.cloth.solvers.vertex_descent import VertexDescent
from vto_pipeline.cloth.solvers.xpbd import Xpbd

SOLVERS: dict[str, type[Newton | Xpbd | Iterated]] = {
    "newton": Newton,
    "xpbd": Xpbd,
    "gauss_seidel": GaussSeidel,
    "jacobi": Jacobi,
    "plain_jacobi": PlainJacobi,
    "chebyshev": Chebyshev,
    "conjugate_residual": ConjugateResidual,
    "anderson": Anderson,
    "projective": Projective,
    "vertex_descent": VertexDescent,
    "fast_projection": FastProjection,
    "pbd_soft": PbdSoft,
}
