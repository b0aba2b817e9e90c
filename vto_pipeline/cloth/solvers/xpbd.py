"""Extended position based dynamics with small steps.

Macklin, Müller & Chentanez 2016 (compliance); Macklin et al. 2019, "Small steps in physics simulation": many substeps
with one Gauss-Seidel sweep each beat few steps with many sweeps. All substeps of a span run in one compiled call.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp

import numpy as np
from numba import njit
from numba.extending import overload

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.collision.response.step_response import resolve_plane_contacts
from vto_pipeline.cloth.constraints.bending.hinge_moments import by_hinges
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM, multipliers, prepare_all, project
from vto_pipeline.cloth.implicit_step.plane_multiplier import solve_plane_contacts
from vto_pipeline.cloth.implicit_step.prediction import predict
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.model.internal_friction import copy_sliders, restore_sliders, slip, with_own_sliders
from vto_pipeline.model.arrays import FloatArray


class Xpbd:
    """The solver with its working memory.

    Args:
        model: The cloth.
        sweeps: Gauss-Seidel sweeps a substep.
        damping: Rate at which velocities fade [1/s].
        max_speed: No vertex moves faster [m/s].

    Attributes:
        model: The cloth as it is solved: curvatures by hinges, with the moments of the others as each sweep finds them.
        forgets: Whether λ is forgotten before each sweep; see `pbd_soft`.
    """

    forgets = False

    has_exact_rest = False  # one sweep a step leaves a share of h² of each constraint's error

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        model = with_own_sliders(model)
        self.model = model = replace(model, constraints=by_hinges(model.constraints))
        self._sweeps = sweeps
        self._damping = damping
        self._max_speed = max_speed
        self._lambdas = multipliers(model.constraints)

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """Return λ of each kind of constraint at the end of the last step, shape (N, B) each."""
        return self._lambdas

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span."""
        restore_sliders(self.model, state.sliders)
        x, v = state.positions.copy(), state.velocities.copy()
        _advance(
            x,
            v,
            self.model.inverse_mass,
            self.model.constraints,
            self._lambdas,
            contacts,
            self.model.gravity,
            h,
            substeps,
            self._sweeps,
            exp(-self._damping * h),
            self._max_speed * h,
            self.forgets,
            len(x) >= PARALLEL_FROM,
        )
        return ClothState(x, v, state.time + substeps * h, copy_sliders(self.model))


@njit(cache=True, error_model="numpy")
def _advance(
    x, v, inverse_mass, constraints, lambdas, contacts, gravity, h, substeps, sweeps, keep, longest, forgets, threaded
):
    start, pressed = np.empty_like(x), np.empty((len(contacts.friction), len(x), 3))
    fall = (h * gravity[0], h * gravity[1], h * gravity[2])
    for step in range(substeps):
        t0, t1 = step / substeps, (step + 1) / substeps
        predict(x, v, start, inverse_mass, fall, h, keep, threaded)
        _reset(lambdas)
        pressed[:] = 0.0
        for _ in range(sweeps):
            if forgets:
                _reset(lambdas)
            prepare_all(x, constraints)
            sweep_once(x, start, inverse_mass, constraints, lambdas, contacts, pressed, t0, t1, h, threaded)
        resolve_plane_contacts(x, v, start, inverse_mass, contacts, t0, t1, h, longest, True, threaded)
        slip(x, constraints)


@njit(cache=True, error_model="numpy")
def sweep_once(x, start, inverse_mass, constraints, lambdas, contacts, pressed, t0, t1, h, threaded):
    """Do one sweep of Gauss-Seidel over constraints and contacts on x, λ and pushes, in place.

    See `constraints.sweep.project` and `plane_multiplier.solve_plane_contacts`.
    """
    project(x, start, inverse_mass, constraints, lambdas, h, threaded)
    if len(contacts.friction) > 0:
        solve_plane_contacts(x, start, inverse_mass, contacts, t0, t1, pressed)


def _reset(lambdas):
    raise NotImplementedError


@overload(_reset)
def _reset_compiled(lambdas):
    if len(lambdas) == 0:
        return lambda lambdas: None

    def unrolled(lambdas):
        lambdas[0][:] = 0.0
        _reset(lambdas[1:])

    return unrolled
