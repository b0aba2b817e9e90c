"""Time integrators of forces: each takes a model, and advances a state in front of contacts, like a solver."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.backward_euler import BackwardEuler
from vto_pipeline.cloth.integrators.backward_euler_newton import BackwardEulerNewton
from vto_pipeline.cloth.integrators.bdf2 import Bdf2
from vto_pipeline.cloth.integrators.explicit_euler import ExplicitEuler
from vto_pipeline.cloth.integrators.imex import Imex
from vto_pipeline.cloth.integrators.implicit_midpoint import ImplicitMidpoint
from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.leapfrog import Leapfrog
from vto_pipeline.cloth.integrators.ncg import Ncg
from vto_pipeline.cloth.integrators.newmark import Newmark
from vto_pipeline.cloth.integrators.predictor_corrector import PredictorCorrector
from vto_pipeline.cloth.integrators.rk2 import Rk2
from vto_pipeline.cloth.integrators.rk4 import Rk4
from vto_pipeline.cloth.integrators.symplectic_euler import SymplecticEuler
from vto_pipeline.cloth.integrators.verlet import Verlet

INTEGRATORS: dict[str, type[Integrator]] = {
    "explicit_euler": ExplicitEuler,
    "symplectic_euler": SymplecticEuler,
    "verlet": Verlet,
    "leapfrog": Leapfrog,
    "rk2": Rk2,
    "rk4": Rk4,
    "predictor_corrector": PredictorCorrector,
    "backward_euler": BackwardEuler,
    "backward_euler_newton": BackwardEulerNewton,
    "implicit_midpoint": ImplicitMidpoint,
    "bdf2": Bdf2,
    "newmark": Newmark,
    "imex": Imex,
    "ncg": Ncg,
}
"""Name -> method. To add one: a file with its `step`, and a line here."""
