"""Extended position based dynamics with small steps.

Macklin, Müller & Chentanez 2016 (compliance); Macklin et al. 2019, "Small steps in physics simulation": many substeps
with one Gauss-Seidel sweep each beat few steps with many sweeps. All substeps of a round run in one compiled call.
"""

from __future__ import annotations

from math import exp

import numpy as np
from numba import njit, prange

from vto_pipeline.cloth.build import ClothModel, ClothState
from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.constraints import Multipliers, multipliers, project, reset
from vto_pipeline.numerics.friction import friction_shift
from vto_pipeline.numerics.vector import add, axpy, dot, load, norm, scale, store, sub, unit

_SERIAL_BELOW = 2500  # vertices; under it, starting the threads costs more than they save
_CHUNK = 512  # vertices a thread takes at a time


class Xpbd:
    """The solver with its working memory.

    Args:
        model: The cloth.
        sweeps: Gauss-Seidel sweeps a substep.
        damping: Rate at which velocities fade [1/s].
        max_speed: No vertex moves faster [m/s].
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        self._model = model
        self._sweeps = sweeps
        self._damping = damping
        self._max_speed = max_speed
        self._lambdas: Multipliers = multipliers(model.constraints)

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span."""
        x, v = state.positions.copy(), state.velocities.copy()
        _advance(
            x,
            v,
            self._model.inverse_mass,
            self._model.constraints,
            self._lambdas,
            contacts,
            self._model.gravity,
            h,
            substeps,
            self._sweeps,
            exp(-self._damping * h),
            self._max_speed * h,
            len(x) >= _SERIAL_BELOW,
        )
        return ClothState(x, v, state.time + substeps * h)


@njit(cache=True, error_model="numpy")
def _advance(x, v, inverse_mass, constraints, lambdas, contacts, gravity, h, substeps, sweeps, keep, longest, threaded):
    start = np.empty_like(x)
    fall = (h * gravity[0], h * gravity[1], h * gravity[2])
    for step in range(substeps):
        if threaded:
            _predict_parallel(x, v, start, inverse_mass, fall, h, keep)
        else:
            _predict(x, v, start, inverse_mass, fall, h, keep, 0, len(x))
        reset(lambdas)
        for sweep in range(sweeps):
            project(x, inverse_mass, constraints, lambdas, h * h, threaded)
            last = sweep == sweeps - 1
            if threaded:
                _touch_parallel(x, v, start, inverse_mass, contacts, step, substeps, h, longest, last)
            else:
                _touch(x, v, start, inverse_mass, contacts, step, substeps, h, longest, last, 0, len(x))


@njit(cache=True, error_model="numpy", parallel=True)
def _predict_parallel(x, v, start, inverse_mass, fall, h, keep):
    for chunk in prange((len(x) + _CHUNK - 1) // _CHUNK):
        _predict(x, v, start, inverse_mass, fall, h, keep, _CHUNK * chunk, min(len(x), _CHUNK * chunk + _CHUNK))


@njit(cache=True, error_model="numpy")
def _predict(x, v, start, inverse_mass, fall, h, keep, first, last):
    """Let vertices first..last move freely for one step."""
    for i in range(first, last):
        store(start, i, load(x, i))
        if inverse_mass[i] > 0.0:
            store(x, i, axpy(h, scale(keep, add(load(v, i), fall)), load(x, i)))


@njit(cache=True, error_model="numpy", parallel=True)
def _touch_parallel(x, v, start, inverse_mass, contacts, step, substeps, h, longest, finish):
    for chunk in prange((len(x) + _CHUNK - 1) // _CHUNK):
        first, last = _CHUNK * chunk, min(len(x), _CHUNK * chunk + _CHUNK)
        _touch(x, v, start, inverse_mass, contacts, step, substeps, h, longest, finish, first, last)


@njit(cache=True, error_model="numpy")
def _touch(x, v, start, inverse_mass, contacts, step, substeps, h, longest, finish, first, last):
    """Put vertices first..last in front of their contact planes, with friction; to finish a step, take their speed."""
    t0, t1 = step / substeps, (step + 1) / substeps
    for i in range(first, last):
        if inverse_mass[i] == 0.0:
            continue
        begin, here = load(start, i), load(x, i)
        for s in range(len(contacts.friction)):
            if not contacts.active[s, i]:
                continue
            p0, p1 = load(contacts.point[s, i], 0), load(contacts.point[s, i], 1)
            n0, n1 = load(contacts.normal[s, i], 0), load(contacts.normal[s, i], 1)
            away = sub(p1, p0)
            normal = unit(axpy(t1, sub(n1, n0), n0))
            offset = contacts.offset[s, i, 0] + t1 * (contacts.offset[s, i, 1] - contacts.offset[s, i, 0])
            push = offset - dot(normal, sub(here, axpy(t1, away, p0)))
            if push > 0.0:
                here = axpy(push, normal, here)
                slip = sub(sub(here, begin), scale(t1 - t0, away))
                here = add(here, friction_shift(slip, normal, push, contacts.friction[s]))
        if finish:
            move = sub(here, begin)
            length = norm(move)
            if length > longest:
                here = axpy(longest / length, move, begin)
                move = sub(here, begin)
            store(v, i, scale(1.0 / h, move))
        store(x, i, here)
