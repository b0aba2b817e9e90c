"""Contacts as part of an implicit step: stiff springs along the normal, and Coulomb friction.

Which contacts push, and which of those hold and which slide, is taken from the last step and put right after each
solution (an active set, as Alart & Curnier 1991 do it), so the system stays linear while it is solved. Friction is
that of a spring in series with a slider, which gives way at μ times the force last seen: return mapping with its
consistent tangent (Simo & Hughes 1998, ch. 1; Wriggers 2006, ch. 9). The spring is about as stiff as the cloth, so what
holds gives way by micrometres; it takes up the friction of the last step, so what rests does not creep.

A plane holds one vertex, and may be as stiff as it likes. Springs across the cloth couple it all, and the stiffer they
are the harder it is to solve; so between pairs they are only as stiff as what they bear asks for, and what they pushed
last is pushed from the start (augmented Lagrangian; Hestenes 1969), which in the end leaves as little of a gap open.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.response.plane_motion import plane_at
from vto_pipeline.numerics.vector import axpy, dot, load, store

_PAIRS = np.int64(1) << 40  # keys from here on are of pairs, those under it of planes
LEVER = 1e-4
"""Of the squares of all weights; where held vertices have the rest, a free one would go 100 times the gap."""
LYING = 1e-4
"""Nearer than this to something that it has not touched yet, cloth that falls begins to push [m]."""


class ActiveSet(NamedTuple):
    """K contacts of one implicit step, sorted by key. In each, weights of at most four vertices say what touches.

    Args:
        key: Which contact it is, the same in the next step, shape (K,).
        vertices: Shape (K, 4).
        weights: Shape (K, 4): with x the point Σ w x, or the way between two points of the cloth; unused ones zero.
        normal: Unit, shape (K, 3).
        level: What normal · Σ w x must reach [m], shape (K,).
        rest_offset: How much farther the spring reaches, so that it pushes as it did last [m], shape (K,).
        carried: How far the surface moves in the step, shape (K, 3) [m].
        friction: Coulomb coefficient, shape (K,).
        pushing: Whether it takes part in the solution, shape (K,).
        normal_stiffness: Stiffness along the normal [N/m], shape (K,).
        tangential_stiffness: Stiffness along the surface, of what holds [N/m], shape (K,).
        initial_friction: Friction at the start of the step [N], shape (K, 3).
        sliding: Whether the slider gives way, shape (K,).
        trial: What friction would have been when last seen, had the slider held [N], shape (K, 3).
        sliding_stiffness: Stiffness of what slides, across the trial's direction [N/m], shape (K,).
        friction_limit: Friction at most [N], shape (K,).
        force: With which each pushed when last seen [N], shape (K,).
        friction_force: Friction when last seen [N], shape (K, 3).
    """

    key: NDArray[np.int64]
    vertices: NDArray[np.int32]
    weights: NDArray[np.float64]
    normal: NDArray[np.float64]
    level: NDArray[np.float64]
    rest_offset: NDArray[np.float64]
    carried: NDArray[np.float64]
    friction: NDArray[np.float64]
    pushing: NDArray[np.bool_]
    normal_stiffness: NDArray[np.float64]
    tangential_stiffness: NDArray[np.float64]
    initial_friction: NDArray[np.float64]
    sliding: NDArray[np.bool_]
    trial: NDArray[np.float64]
    sliding_stiffness: NDArray[np.float64]
    friction_limit: NDArray[np.float64]
    force: NDArray[np.float64]
    friction_force: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def no_contacts(count):
    """Return room for this many contacts, none of which pushes."""
    return ActiveSet(
        np.zeros(count, np.int64),
        np.zeros((count, 4), np.int32),
        np.zeros((count, 4)),
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count),
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count, np.bool_),
        np.zeros(count),
        np.zeros(count),
        np.zeros((count, 3)),
        np.zeros(count, np.bool_),
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count),
        np.zeros(count),
        np.zeros((count, 3)),
    )


@njit(cache=True, error_model="numpy")
def active_set(contacts, pairs, t0, t1, inverse_mass, x, drift, before, lying):
    """Return the contacts where they are at the end of a step, with a guess which of them push.

    Args:
        contacts: Planes of the span.
        pairs: Of the cloth with itself and with bodies.
        t0, t1: Begin and end of the step as shares of the span.
        inverse_mass: [1/kg], shape (V,).
        x: Positions at the start [m], shape (V, 3).
        drift: How far vertices go by their speed alone [m], shape (V, 3). In a long step they would fall much farther,
            were they free; but cloth holds most, and a contact guessed wrongly draws it to what it is far away from.
        before: The active set of the last step.
        lying: What is nearer than this to something that it has not touched yet begins to push [m].
    """
    found = no_contacts(np.sum(contacts.active) + len(pairs.key))
    count = 0
    for s in range(len(contacts.friction)):
        for i in range(len(x)):
            if not contacts.active[s, i] or inverse_mass[i] == 0.0:
                continue
            normal, place, offset, carried = plane_at(contacts, s, i, t0, t1)
            found.key[count] = s * len(x) + i
            found.vertices[count, 0], found.weights[count, 0] = i, 1.0
            found.level[count] = dot(normal, place) + offset
            found.friction[count] = contacts.friction[s]
            store(found.normal, count, normal)
            store(found.carried, count, carried)
            count += 1
    for p in range(len(pairs.key)):
        _fill_from_pair(found, count, pairs, p)
        count += 1
    for c in range(count):
        _warm_start(found, c, before, x, drift, lying)
    return _subset(found, np.arange(count))


def add_pairs(contacts, pairs, x, guess):  # type: ignore[no-untyped-def]
    """Return the contacts with those of the pairs that are not among them.

    Args:
        contacts: Of the step.
        pairs: Of the cloth with itself.
        x: Positions at the start [m], shape (V, 3).
        guess: How far vertices would go without them [m], shape (V, 3).
    """
    unknown = ~np.isin(_PAIRS + pairs.key, contacts.key)
    if not unknown.any():
        return contacts
    arriving = _new_contacts(pairs, np.flatnonzero(unknown), contacts, x, guess)
    both = [np.concatenate(parts) for parts in zip(contacts, arriving, strict=True)]
    order = np.argsort(both[0], kind="stable")
    return ActiveSet(*(part[order] for part in both))


@njit(cache=True, error_model="numpy")
def _new_contacts(pairs, places, contacts, x, guess):
    found = no_contacts(len(places))
    for c in range(len(places)):
        _fill_from_pair(found, c, pairs, places[c])
        _warm_start(found, c, contacts, x, guess, LYING)
    return found


@njit(cache=True, error_model="numpy")
def _fill_from_pair(contacts, c, pairs, p):
    contacts.key[c] = _PAIRS + pairs.key[p]
    contacts.vertices[c], contacts.weights[c] = pairs.vertices[p], pairs.weights[p]
    n = load(pairs.normal, p)
    contacts.normal[c], contacts.level[c] = pairs.normal[p], pairs.gap[p] - dot(n, load(pairs.fixed, p))
    contacts.carried[c], contacts.friction[c] = pairs.carried[p], pairs.friction[p]


@njit(cache=True, error_model="numpy")
def _subset(contacts, places):
    """Return the contacts at these places, in this order."""
    return ActiveSet(
        contacts.key[places],
        contacts.vertices[places],
        contacts.weights[places],
        contacts.normal[places],
        contacts.level[places],
        contacts.rest_offset[places],
        contacts.carried[places],
        contacts.friction[places],
        contacts.pushing[places],
        contacts.normal_stiffness[places],
        contacts.tangential_stiffness[places],
        contacts.initial_friction[places],
        contacts.sliding[places],
        contacts.trial[places],
        contacts.sliding_stiffness[places],
        contacts.friction_limit[places],
        contacts.force[places],
        contacts.friction_force[places],
    )


@njit(cache=True, error_model="numpy")
def _warm_start(found, c, before, x, way, lying):
    """Guess whether contact c pushes and slides: as in the last step, or where its vertices are going."""
    n = load(found.normal, c)
    place = np.searchsorted(before.key, found.key[c])
    pushed, near = False, lying
    if place < len(before.key) and before.key[place] == found.key[c]:
        pushed, near = before.pushing[place], 0.0
        found.force[c], found.sliding[c] = before.force[place], before.sliding[place]
        store(found.trial, c, tangential(n, load(before.trial, place)))  # the normal has turned since
        store(found.initial_friction, c, tangential(n, load(before.friction_force, place)))
        store(found.friction_force, c, load(found.initial_friction, c))
    found.sliding[c] |= found.force[c] == 0.0  # how hard it will push, and so rub, is not known
    reached = dot(n, sum_at(found, c, x)) + dot(n, sum_at(found, c, way))
    found.pushing[c] = reached < found.level[c] + near or pushed


@njit(cache=True, error_model="numpy")
def sum_at(contacts, c, x):
    """Return Σ w x of a contact."""
    total = (0.0, 0.0, 0.0)
    for s in range(4):
        total = axpy(contacts.weights[c, s], load(x, contacts.vertices[c, s]), total)
    return total


@njit(cache=True, error_model="numpy")
def inverse_effective_mass(contacts, c, inverse_mass):
    """Return how far a unit of force times time squared moves what contact c keeps apart [1/kg].

    None where nothing of it can move, or what can is all but beside it.
    """
    total = free = whole = 0.0
    for s in range(4):
        w_sq, inverse = contacts.weights[c, s] ** 2, inverse_mass[contacts.vertices[c, s]]
        total += w_sq * inverse
        whole += w_sq
        if inverse > 0.0:
            free += w_sq
    return total if free > LEVER * whole else 0.0


@njit(cache=True, error_model="numpy")
def tangential(normal, a):
    """Return the part of a along the surface."""
    return axpy(-dot(normal, a), normal, a)
