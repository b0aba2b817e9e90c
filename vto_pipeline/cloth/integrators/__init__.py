"""Time integrators of forces: each takes a model and advances a state subject to contacts.

integrator: what all of them share
explicit, implicit, multistep: the families, one class a method
system, air: forces and resistance, air drag among them
potential, minimise: an implicit step as a minimum, and two ways to find it
"""

from __future__ import annotations

from vto_pipeline.cloth.integrators.explicit import ExplicitEuler, Leapfrog, Rk2, Rk4, SymplecticEuler, Verlet
from vto_pipeline.cloth.integrators.implicit import (
    BackwardEuler,
    BackwardEulerNewton,
    Imex,
    ImplicitMidpoint,
    Ncg,
    Newmark,
)
from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.multistep import Bdf2, PredictorCorrector

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
"""Name -> method. To add one: a class with its `step` in the file of its family, and a line here."""
