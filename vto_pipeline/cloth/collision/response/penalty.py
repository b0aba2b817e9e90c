"""Penalty contacts: a spring along the normal, a damper, and Coulomb friction.

What methods that only know forces can do; to compare with contacts that are solved for. A spring gives way before it
bears: cloth sinks in, and by more where it comes fast or lies under a load (Moore & Wilhelms 1988, section 4). Friction
is a spring in series with a slider, as in `contact_springs`, but it may go up to μ times the push at the start of the
step, so that it has a potential: Huber's function of the slip.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.collision.response.active_set import (
    LYING,
    active_set,
    inverse_effective_mass,
    no_contacts,
    sum_at,
    tangential,
)
from vto_pipeline.cloth.collision.self_collision.pairs import Pairs
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix
from vto_pipeline.numerics.vector import axpy, dot, load, norm, scale, store, sub, unit
from vto_pipeline.units import GRAVITY

_GIVES = 0.999  # of the friction at most, from where a slider is about to give way
_SINKS = 1e-5  # m: how far a vertex at rest sinks under its own weight; layers of 0.3 mm then bear 30 times that

FREQUENCY = 2.0 * sqrt(GRAVITY / _SINKS)
"""Of a vertex on a damped spring, to choose steps by [rad/s]."""


class Penalty:
    """The contacts of a cloth, step by step.

    Args:
        model: The cloth.
    """

    def __init__(self, model: ClothModel) -> None:
        self._inverse_mass = model.inverse_mass
        self._active = no_contacts(0)
        self._start = np.empty((0, 3))
        self._h = 1.0

    def begin(self, contacts: Contacts, pairs: Pairs, t0: float, t1: float, x: FloatArray, h: float) -> None:
        """Take the contacts to a step.

        Args:
            contacts: Planes of the span.
            pairs: Of the cloth with itself and with bodies.
            t0, t1: Begin and end of the step as shares of the span.
            x: Positions at its begin [m], shape (V, 3).
            h: How long it takes [s].
        """
        still = np.zeros_like(x)
        self._start, self._h = x, h
        self._active = active_set(contacts, pairs, t0, t1, self._inverse_mass, x, still, self._active, LYING)
        _set_springs(self._active, self._inverse_mass, x)

    def end(self, y: FloatArray) -> None:
        """Note what friction a step that ends here [m], shape (V, 3), leaves to the next."""
        _note_friction(self._active, self._start, y)

    def add_forces(self, y: FloatArray, forces: FloatArray) -> float:
        """Add the forces at these positions [m], shape (V, 3), to the given ones [N]; return their potential [J]."""
        return float(_add_forces(self._active, self._start, y, forces))

    def add_resistance(self, x: FloatArray, v: FloatArray, forces: FloatArray) -> float:
        """Add the forces of the dampers to the given ones [N]; return their potential in v [W].

        Args:
            x: Positions [m], shape (V, 3).
            v: Velocities [m/s], shape (V, 3).
            forces: Changed in place, shape (V, 3).
        """
        return float(_add_resistance(self._active, self._inverse_mass, self._h, x, v, forces))

    def add_to(self, matrix: BlockMatrix, y: FloatArray, rate: float) -> None:
        """Add a bound of the stiffness at positions y [m], shape (V, 3), and of the dampers, to a matrix.

        Of contacts between several vertices only the diagonal has room: |wᵢ| Σ|w| times the stiffness bounds the rest.

        Args:
            matrix: Of the cloth.
            y: Positions [m], shape (V, 3).
            rate: How fast velocities change with y [1/s].
        """
        _add_stiffness(self._active, self._inverse_mass, self._start, y, rate, matrix)


@njit(cache=True, error_model="numpy")
def _set_springs(contacts, inverse_mass, x):
    """Set how stiff contacts are, and the friction at most, from what they push with at the start of a step."""
    for c in range(len(contacts.key)):
        give = inverse_effective_mass(contacts, c, inverse_mass)
        contacts.normal_stiffness[c] = contacts.tangential_stiffness[c] = (
            GRAVITY / (give * _SINKS) if give > 0.0 else 0.0
        )
        contacts.friction_limit[c] = (
            contacts.friction[c] * contacts.normal_stiffness[c] * max(0.0, -_gap(contacts, c, x))
        )


@njit(cache=True, error_model="numpy")
def _gap(contacts, c, y):
    return dot(load(contacts.normal, c), sum_at(contacts, c, y)) - contacts.level[c]


@njit(cache=True, error_model="numpy")
def _tangential_extension(contacts, c, x, y):
    """Return by how much the spring of the friction is drawn [m], were its slider to hold."""
    moved = sub(sub(sum_at(contacts, c, y), sum_at(contacts, c, x)), load(contacts.carried, c))
    slip = tangential(load(contacts.normal, c), moved)
    return axpy(-1.0 / contacts.tangential_stiffness[c], load(contacts.initial_friction, c), slip)


@njit(cache=True, error_model="numpy")
def _friction_force(contacts, c, drawn):
    """Return the friction [N]."""
    asked = contacts.tangential_stiffness[c] * norm(drawn)
    return scale(
        -contacts.tangential_stiffness[c] * (min(1.0, contacts.friction_limit[c] / asked) if asked > 0.0 else 1.0),
        drawn,
    )


@njit(cache=True, error_model="numpy")
def _add_forces(contacts, x, y, forces):
    energy = 0.0
    for c in range(len(contacts.key)):
        spring, hold = contacts.normal_stiffness[c], contacts.friction_limit[c]
        if spring == 0.0:
            continue
        pull, gap = (0.0, 0.0, 0.0), _gap(contacts, c, y)
        if gap < 0.0:
            energy += 0.5 * spring * gap * gap
            pull = scale(-spring * gap, load(contacts.normal, c))
        if hold > 0.0:
            drawn = _tangential_extension(contacts, c, x, y)
            length = norm(drawn)
            if contacts.tangential_stiffness[c] * length <= hold:
                energy += 0.5 * contacts.tangential_stiffness[c] * length * length
            else:
                energy += hold * (length - 0.5 * hold / contacts.tangential_stiffness[c])
            pull = axpy(1.0, _friction_force(contacts, c, drawn), pull)
        for s in range(4):
            i = contacts.vertices[c, s]
            store(forces, i, axpy(contacts.weights[c, s], pull, load(forces, i)))
    return energy


@njit(cache=True, error_model="numpy")
def _note_friction(contacts, x, y):
    for c in range(len(contacts.key)):
        store(contacts.friction_force, c, (0.0, 0.0, 0.0))
        if contacts.friction_limit[c] > 0.0 and _gap(contacts, c, y) < 0.0:
            store(contacts.friction_force, c, _friction_force(contacts, c, _tangential_extension(contacts, c, x, y)))


@njit(cache=True, error_model="numpy")
def _damper(contacts, c, inverse_mass, x):
    """Return the strength of the damper of contact c [N s/m]: critical, where its spring pushes."""
    if contacts.normal_stiffness[c] == 0.0 or _gap(contacts, c, x) >= 0.0:
        return 0.0
    return 2.0 * np.sqrt(contacts.normal_stiffness[c] / inverse_effective_mass(contacts, c, inverse_mass))


@njit(cache=True, error_model="numpy")
def _add_resistance(contacts, inverse_mass, h, x, v, forces):
    power = 0.0
    for c in range(len(contacts.key)):
        strength = _damper(contacts, c, inverse_mass, x)
        if strength == 0.0:
            continue
        n = load(contacts.normal, c)
        speed = dot(n, axpy(-1.0 / h, load(contacts.carried, c), sum_at(contacts, c, v)))
        power += 0.5 * strength * speed * speed
        pull = scale(-strength * speed, n)
        for s in range(4):
            i = contacts.vertices[c, s]
            store(forces, i, axpy(contacts.weights[c, s], pull, load(forces, i)))
    return power


@njit(cache=True, error_model="numpy")
def _add_stiffness(contacts, inverse_mass, x, y, rate, matrix):
    for c in range(len(contacts.key)):
        if contacts.normal_stiffness[c] == 0.0:
            continue
        n = load(contacts.normal, c)
        normal = contacts.normal_stiffness[c] if _gap(contacts, c, y) < 0.0 else 0.0
        normal += rate * _damper(contacts, c, inverse_mass, x)
        along, slack, t = 0.0, 0.0, (0.0, 0.0, 0.0)
        if contacts.friction_limit[c] > 0.0:
            drawn = _tangential_extension(contacts, c, x, y)
            asked = contacts.tangential_stiffness[c] * norm(drawn)
            along = contacts.tangential_stiffness[c]
            if asked > _GIVES * contacts.friction_limit[c]:
                along *= min(1.0, contacts.friction_limit[c] / asked)
                slack, t = along, unit(drawn)
        whole = np.sum(np.abs(contacts.weights[c]))
        for s in range(4):
            i, w = contacts.vertices[c, s], abs(contacts.weights[c, s])
            if w == 0.0 or inverse_mass[i] == 0.0:
                continue
            block = matrix.blocks[matrix.diagonal[i]]
            for k in range(3):
                block[k, k] += w * whole * along
                for m in range(3):
                    block[k, m] += w * whole * ((normal - along) * n[k] * n[m] - slack * t[k] * t[m])
