"""Residual force of a cloth at equilibrium, independent of the path to it."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.response.active_set import ActiveSet, sum_at
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.vector import axpy, dot, load, norm, scale, store, sub
from vto_pipeline.units import GRAVITY

_TOUCHING = 1e-4  # m: what is farther apart bears nothing
_SWEEPS = 200  # at most, to find what contacts bear
_SETTLED = 1e-4  # of the forces: a sweep that changes less is the last


def relative_residual(model: ClothModel, positions: FloatArray, contacts: ActiveSet) -> float:
    """Return the residual force as a share of weight: the acceleration left over, rms over the free mass, in g.

    Internal forces and gravity, less the most that contacts can bear: forces inside their friction cones, with bodies
    and of the cloth with itself. By mass, as any triangulation of the same cloth gives: the tip of a sliver weighs
    nothing, so the least push on it is many times its weight.

    Args:
        model: The cloth.
        positions: [m], shape (V, 3).
        contacts: With what it may touch there. The search begins at the forces they are known to bear.
    """
    forces = model.mass[:, None] * model.gravity
    add_forces(positions, model.constraints, forces)
    free = model.inverse_mass > 0.0
    if not free.any():
        return 0.0
    _remove_contact_reactions(forces, positions, contacts, np.where(free, model.inverse_mass, 0.0))
    mass = model.mass[free]
    share = np.linalg.norm(forces[free], axis=1) / (mass * GRAVITY)
    return float(np.sqrt(np.average(share**2, weights=mass)))


def elastic_energy(model: ClothModel, positions: FloatArray) -> float:
    """Return the energy stored in the cloth [J]."""
    return float(add_forces(positions, model.constraints, np.zeros_like(positions)))


@njit(cache=True, error_model="numpy")
def _remove_contact_reactions(forces, positions, contacts, inverse_mass):  # type: ignore[no-untyped-def]
    """Take from the forces what contacts can bear, in place: projected Gauss-Seidel on Σ |force|² / mass."""
    borne = np.zeros((len(contacts.key), 3))
    total = 0.0
    for i in range(len(forces)):
        total += norm(load(forces, i)) * inverse_mass[i]
    for c in range(len(contacts.key)):
        n = load(contacts.normal, c)
        if contacts.force[c] > 0.0 and _touches(contacts, c, positions):
            known = _project_to_friction_cone(
                axpy(contacts.force[c], n, load(contacts.friction_force, c)), n, contacts.friction[c]
            )
            store(borne, c, known)
            _push(forces, contacts, c, known, inverse_mass)
    for _ in range(_SWEEPS):
        changed = 0.0
        for c in range(len(contacts.key)):
            n = load(contacts.normal, c)
            if not _touches(contacts, c, positions):
                continue
            pull, give, weight = (0.0, 0.0, 0.0), 0.0, 0.0
            for s in range(4):
                i = contacts.vertices[c, s]
                per = contacts.weights[c, s] * inverse_mass[i]
                pull, give = axpy(per, load(forces, i), pull), give + contacts.weights[c, s] * per
                weight += abs(contacts.weights[c, s]) * inverse_mass[i]
            if give == 0.0:
                continue
            before = load(borne, c)
            after = _project_to_friction_cone(axpy(-1.0 / give, pull, before), n, contacts.friction[c])
            store(borne, c, after)
            move = sub(after, before)
            changed += weight * norm(move)
            _push(forces, contacts, c, move, inverse_mass)
        if changed <= _SETTLED * total:
            break


@njit(cache=True, error_model="numpy")
def _touches(contacts, c, positions):  # type: ignore[no-untyped-def]
    """Return whether what a contact keeps apart is no farther apart than that."""
    return dot(load(contacts.normal, c), sum_at(contacts, c, positions)) - contacts.level[c] <= _TOUCHING


@njit(cache=True, error_model="numpy")
def _push(forces, contacts, c, force, inverse_mass):  # type: ignore[no-untyped-def]
    """Add the force of a contact to those of its vertices that are free."""
    for s in range(4):
        i = contacts.vertices[c, s]
        if inverse_mass[i] > 0.0:
            store(forces, i, axpy(contacts.weights[c, s], force, load(forces, i)))


@njit(cache=True, error_model="numpy")
def _project_to_friction_cone(force, normal, friction):  # type: ignore[no-untyped-def]
    """Return the push along the normal and the friction that go with it, of a force that is asked for."""
    push = dot(force, normal)
    if push <= 0.0:
        return (0.0, 0.0, 0.0)
    along = axpy(-push, normal, force)
    asked = norm(along)
    if asked > friction * push:
        along = scale(friction * push / asked, along)
    return axpy(push, normal, along)
