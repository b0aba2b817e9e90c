"""Contribution of contacts to the linear system of an implicit step, and their update from its solution."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.response.active_set import LEVER, inverse_effective_mass, sum_at, tangential
from vto_pipeline.numerics.vector import axpy, dot, load, norm, scale, store, sub, unit

_HARD = 30.0  # times the stiffness of what lies on a plane
_SOFT = 1e2  # times mass / h², of pairs
_FIRM = 4.0  # last force / gap: with that stiffness, as much again would take a quarter of the gap
_LOST = 0.5  # share of the gap; where more is lost, the spring was too soft for what it bears
_NO_LENGTH = 1e-300  # m
_NOTHING = 1e-6  # m: of a gap smaller than this nothing can be lost
_STIFFER = 1e3  # times mass / h²: a free vertex at rest on a plane sinks g h² / 1000, 3 µm at 1/60 s


@njit(cache=True, error_model="numpy")
def add_contacts(contacts, mass, held, h, x, y, matrix, right, blocks, firm):
    """Add the contacts that push to the system (matrix and links) d = right for the move d from y.

    Args:
        contacts: Their stiffnesses are set here.
        mass: [kg], shape (V,).
        held: Vertices that do not move, shape (V,).
        h: Step [s].
        x, y: Positions at the start of the step and now [m], shape (V, 3).
        matrix: Contacts of a single vertex are added to its diagonal blocks.
        right: Forces [N], shape (V, 3), changed in place.
        blocks: Filled for contacts of several vertices that push, in their order, shape (P, 3, 3).
        firm: Whether those are as stiff as the cloth, whatever they bear: cloth that would buckle between two layers
            is held by nothing else. Elimination solves that as fast; cycles of multigrid do not.
    """
    linked = 0
    single = np.empty((3, 3))
    _set_springs(contacts, mass, held, h, matrix, firm)
    for c in range(len(contacts.key)):
        if not contacts.pushing[c]:
            continue
        n, spring = load(contacts.normal, c), contacts.normal_stiffness[c]
        _set_friction(contacts, c)
        pull = axpy(-spring * _gap(contacts, c, y), n, _friction(contacts, c, _slip(contacts, c, x, y)))
        across, along, t = contacts.sliding_stiffness[c], 0.0, unit(load(contacts.trial, c))
        if contacts.sliding[c]:
            along = across
        for s in range(4):
            i, w = contacts.vertices[c, s], contacts.weights[c, s]
            if not held[i]:
                store(right, i, axpy(w, pull, load(right, i)))
        lone = is_single(contacts, c)
        block = matrix.blocks[matrix.diagonal[contacts.vertices[c, 0]]] if lone else single
        if not lone:
            block[:] = 0.0
        for k in range(3):
            block[k, k] += across
            for m in range(3):
                block[k, m] += (spring - across) * n[k] * n[m] - along * t[k] * t[m]
        if not lone:
            blocks[linked] = block
            linked += 1


@njit(cache=True, error_model="numpy")
def is_single(contacts, c):
    """Return whether one vertex alone is touched."""
    return contacts.weights[c, 1] == 0.0 and contacts.weights[c, 2] == 0.0 and contacts.weights[c, 3] == 0.0


@njit(cache=True, error_model="numpy")
def _is_against_other(contacts, c):
    """Return whether something else than cloth is touched: the weights are of a place, not of a way between two."""
    w = contacts.weights[c]
    return abs(w[0] + w[1] + w[2] + w[3]) > 0.5


@njit(cache=True, error_model="numpy")
def linked_contacts(contacts, held):
    """Return vertices and weights, shapes (P, 4), of contacts of several vertices that push; held ones have none."""
    count = 0
    vertices, weights = np.empty((len(contacts.key), 4), np.int32), np.empty((len(contacts.key), 4))
    for c in range(len(contacts.key)):
        if contacts.pushing[c] and not is_single(contacts, c):
            vertices[count] = contacts.vertices[c]
            for s in range(4):
                weights[count, s] = 0.0 if held[contacts.vertices[c, s]] else contacts.weights[c, s]
            count += 1
    return vertices[:count], weights[:count]


@njit(cache=True, error_model="numpy")
def _set_springs(contacts, mass, held, h, matrix, firm):
    """Make planes stiffer than the cloth holds what they touch, and all much stiffer than inertia.

    Where the exact stiffness of pressed cloth is negative, it counts as none.
    """
    for c in range(len(contacts.key)):
        give = stiff_give = free = whole = 0.0
        lone = _is_against_other(contacts, c)
        for s in range(4):
            i, w = contacts.vertices[c, s], contacts.weights[c, s]
            whole += w * w
            if w != 0.0 and not held[i]:
                free += w * w
                inertia = mass[i] / (h * h)
                block = matrix.blocks[matrix.diagonal[i]]
                stiff = max((block[0, 0] + block[1, 1] + block[2, 2]) / 3.0, 0.0) + _STIFFER * inertia
                stiff_give += w * w / stiff
                give += w * w / (_SOFT * inertia)
        if free <= LEVER * whole:  # nothing of it can move, or what can is all but beside it
            contacts.normal_stiffness[c] = contacts.tangential_stiffness[c] = contacts.rest_offset[c] = 0.0
            continue
        if lone:
            contacts.normal_stiffness[c] = _HARD / stiff_give
            contacts.rest_offset[c] = contacts.force[c] / contacts.normal_stiffness[c]
        else:
            borne = _FIRM * contacts.force[c] / max(contacts.level[c], _NO_LENGTH)
            enough = 1.0 / stiff_give if firm else max(1.0 / give, borne)
            contacts.normal_stiffness[c] = min(1.0 / stiff_give, enough)
            contacts.rest_offset[c] = contacts.force[c] / contacts.normal_stiffness[c]
        contacts.tangential_stiffness[c] = min(1.0 / stiff_give, contacts.normal_stiffness[c])


@njit(cache=True, error_model="numpy")
def project_to_contacts(contacts, inverse_mass, x, y, move):
    """Change a guess of the move from y so that contacts that push are reached, and what holds does not slip.

    Args:
        contacts: What pushes and what slides.
        inverse_mass: [1/kg], shape (V,).
        x, y: Positions at the start of the step and now [m], shape (V, 3).
        move: Changed in place [m], shape (V, 3).
    """
    for c in range(len(contacts.key)):
        if not contacts.pushing[c]:
            continue
        give = inverse_effective_mass(contacts, c, inverse_mass)
        if give == 0.0 or contacts.normal_stiffness[c] == 0.0:
            continue
        n, now, moved = load(contacts.normal, c), sum_at(contacts, c, y), sum_at(contacts, c, move)
        shift = scale(contacts.level[c] - dot(n, now) - dot(n, moved), n)
        if contacts.friction[c] > 0.0 and not contacts.sliding[c]:
            way = sub(sub(now, sum_at(contacts, c, x)), load(contacts.carried, c))
            shift = sub(shift, tangential(n, axpy(1.0, moved, way)))
        for s in range(4):
            i = contacts.vertices[c, s]
            store(move, i, axpy(contacts.weights[c, s] * inverse_mass[i] / give, shift, load(move, i)))


@njit(cache=True, error_model="numpy")
def contact_energy(contacts, x, y):
    """Return the energy of the springs, and the work against friction, at positions y after a step from x [J]."""
    energy = 0.0
    for c in range(len(contacts.key)):
        if contacts.pushing[c]:
            gap = _gap(contacts, c, y)
            off = _tangential_extension(contacts, c, _slip(contacts, c, x, y))
            energy += 0.5 * contacts.normal_stiffness[c] * gap * gap + 0.5 * contacts.sliding_stiffness[c] * dot(
                off, off
            )
            if contacts.sliding[c]:
                energy -= contacts.friction_limit[c] * dot(unit(load(contacts.trial, c)), _slip(contacts, c, x, y))
    return energy


@njit(cache=True, error_model="numpy")
def displacement_by_planes(contacts, x):
    """Return how far planes on their path take along the vertices that would else be behind them [m], shape (V, 3).

    Args:
        contacts: Of the step.
        x: Positions at its begin [m], shape (V, 3).
    """
    pushed = np.zeros_like(x)
    for c in range(len(contacts.key)):
        if is_single(contacts, c) and dot(load(contacts.normal, c), sum_at(contacts, c, x)) < contacts.level[c]:
            store(pushed, contacts.vertices[c, 0], load(contacts.carried, c))
    return pushed


@njit(cache=True, error_model="numpy")
def add_last_forces(contacts, forces):
    """Add what the contacts did when last seen to the forces on the vertices [N], shape (V, 3), in place."""
    for c in range(len(contacts.key)):
        if contacts.force[c] > 0.0:
            pull = axpy(contacts.force[c], load(contacts.normal, c), load(contacts.friction_force, c))
            for s in range(4):
                i = contacts.vertices[c, s]
                store(forces, i, axpy(contacts.weights[c, s], pull, load(forces, i)))


@njit(cache=True, error_model="numpy")
def update_active_set(contacts, x, y, allowed):
    """Update which contacts push and which slide after a solution, and record the forces.

    Args:
        contacts: Changed in place.
        x, y: Positions at the start and at the end of the step [m], shape (V, 3).
        allowed: How far a contact may be crossed without being put right [m].

    Returns:
        The forces that were not as they should be, as a share of those that pushed.
    """
    amiss = total = 0.0
    for c in range(len(contacts.key)):
        gap, slip = _gap(contacts, c, y), _slip(contacts, c, x, y)
        if not contacts.pushing[c]:
            if gap < 0.0:  # from now on; how hard, and so how it rubs, is not known yet
                contacts.pushing[c] = contacts.sliding[c] = True
                amiss += -contacts.normal_stiffness[c] * gap if gap < -allowed else 0.0
            continue
        if gap > 0.0:
            amiss += contacts.normal_stiffness[c] * gap  # what pushes does not pull
            contacts.pushing[c] = contacts.sliding[c] = False
            contacts.force[c] = contacts.rest_offset[c] = 0.0
            store(contacts.initial_friction, c, (0.0, 0.0, 0.0))
            store(contacts.friction_force, c, (0.0, 0.0, 0.0))
            continue
        push = -contacts.normal_stiffness[c] * gap
        total += push
        if not _is_against_other(contacts, c) and gap + contacts.rest_offset[c] < -max(
            _LOST * contacts.level[c], _NOTHING
        ):
            amiss += push
        contacts.force[c] = push
        if contacts.friction[c] == 0.0:
            continue
        solved = _friction(contacts, c, slip)
        trial = axpy(-contacts.tangential_stiffness[c], slip, load(contacts.initial_friction, c))
        most, asked = contacts.friction[c] * push, norm(trial)
        rub = scale(most / asked, trial) if asked > most else trial
        amiss += norm(sub(rub, solved))
        turned = contacts.sliding[c] and dot(trial, load(contacts.trial, c)) < 0.0  # between the two it holds
        contacts.sliding[c] = asked > most and not turned
        store(contacts.trial, c, trial)
        store(contacts.friction_force, c, rub)
    if total > 0.0:
        return amiss / total
    return 1.0 if amiss > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _set_friction(contacts, c):
    """Set the stiffness of what slides, and the friction at most, from what was last seen."""
    contacts.friction_limit[c] = contacts.friction[c] * contacts.force[c]
    contacts.sliding_stiffness[c] = contacts.tangential_stiffness[c] if contacts.friction[c] > 0.0 else 0.0
    if contacts.sliding[c]:
        asked = norm(load(contacts.trial, c))
        contacts.sliding_stiffness[c] *= min(1.0, contacts.friction_limit[c] / asked) if asked > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _friction(contacts, c, slip):
    """Return the friction after a slip, as the linear system has it [N]."""
    rub = scale(-contacts.sliding_stiffness[c], _tangential_extension(contacts, c, slip))
    if contacts.sliding[c]:
        rub = axpy(contacts.friction_limit[c], unit(load(contacts.trial, c)), rub)
    return rub


@njit(cache=True, error_model="numpy")
def _tangential_extension(contacts, c, slip):
    """Return by how much the spring is drawn after a slip, were the slider to hold [m]; what slides, sideways only."""
    if contacts.sliding_stiffness[c] == 0.0:
        return (0.0, 0.0, 0.0)
    off = axpy(-1.0 / contacts.tangential_stiffness[c], load(contacts.initial_friction, c), slip)
    if contacts.sliding[c]:
        t = unit(load(contacts.trial, c))
        off = axpy(-dot(t, off), t, off)
    return off


@njit(cache=True, error_model="numpy")
def _gap(contacts, c, y):
    """Return how far contact c is from where its spring begins to push [m]; negative where it does."""
    return dot(load(contacts.normal, c), sum_at(contacts, c, y)) - contacts.level[c] - contacts.rest_offset[c]


@njit(cache=True, error_model="numpy")
def _slip(contacts, c, x, y):
    """Return how far contact c moved along the surface, against it [m]."""
    moved = sub(sub(sum_at(contacts, c, y), sum_at(contacts, c, x)), load(contacts.carried, c))
    return tangential(load(contacts.normal, c), moved)
