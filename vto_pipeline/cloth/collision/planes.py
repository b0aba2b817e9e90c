"""Contact planes as part of an implicit step: stiff springs along the normal, and Coulomb friction.

Which planes push, and which of those hold and which slide, is taken from the last step and put right after each
solution (an active set, as Alart & Curnier 1991 do it), so the system stays linear while it is solved. A vertex that
holds is held by the same spring; one that slides is pulled back by μ times the force last seen, against the slip last
seen, with the stiffness that Coulomb's force has across its direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.numerics.vector import add, axpy, dot, load, norm, scale, store, sub, unit

_STIFFER = 1e3  # times mass / h²: a free vertex at rest on a plane sinks g h² / 1000, 3 µm at 1/60 s


class Planes(NamedTuple):
    """Planes of one implicit step, one of each surface S for each vertex V.

    Args:
        normal: Unit, shape (S, V, 3).
        level: What normal · x must reach [m], shape (S, V).
        carried: How far the surface moves in the step, shape (S, V, 3) [m].
        there: Whether there is a plane, shape (S, V).
        friction: Shape (S,).
        pushing: Whether it takes part in the solution, shape (S, V).
        spring: Stiffness along the normal, and against slip of what holds [N/m], shape (S, V).
        sliding: Whether it slides, shape (S, V).
        slide: Direction of the slip, unit, shape (S, V, 3).
        across: Stiffness across that direction [N/m], shape (S, V).
        hold: Friction at most [N], shape (S, V).
        force: With which each pushed when last seen [N], shape (S, V).
    """

    normal: NDArray[np.float64]
    level: NDArray[np.float64]
    carried: NDArray[np.float64]
    there: NDArray[np.bool_]
    friction: NDArray[np.float64]
    pushing: NDArray[np.bool_]
    spring: NDArray[np.float64]
    sliding: NDArray[np.bool_]
    slide: NDArray[np.float64]
    across: NDArray[np.float64]
    hold: NDArray[np.float64]
    force: NDArray[np.float64]


def planes(surfaces: int, vertices: int) -> Planes:
    """Return room for the planes of so many surfaces and vertices."""
    shape = (surfaces, vertices)
    return Planes(
        np.zeros((*shape, 3)),
        np.zeros(shape),
        np.zeros((*shape, 3)),
        np.zeros(shape, np.bool_),
        np.zeros(surfaces),
        np.zeros(shape, np.bool_),
        np.zeros(shape),
        np.zeros(shape, np.bool_),
        np.zeros((*shape, 3)),
        np.zeros(shape),
        np.zeros(shape),
        np.zeros(shape),
    )


@njit(cache=True, error_model="numpy")
def place_planes(planes, contacts, t0, t1, inverse_mass, x, guess):
    """Put the planes where they are at the end of a step, and guess which push.

    Args:
        planes: Changed in place.
        contacts: Of the round.
        t0, t1: Begin and end of the step as shares of the round.
        inverse_mass: [1/kg], shape (V,).
        x: Positions at the begin [m], shape (V, 3).
        guess: How far vertices would go by themselves [m], shape (V, 3).
    """
    for s in range(len(contacts.friction)):
        planes.friction[s] = contacts.friction[s]
        for i in range(len(x)):
            there = contacts.active[s, i] and inverse_mass[i] > 0.0
            planes.there[s, i] = there
            if not there:
                planes.pushing[s, i] = planes.sliding[s, i] = False
                planes.force[s, i] = 0.0
                continue
            p0, p1 = load(contacts.point[s, i], 0), load(contacts.point[s, i], 1)
            n0, n1 = load(contacts.normal[s, i], 0), load(contacts.normal[s, i], 1)
            away = sub(p1, p0)
            normal = unit(axpy(t1, sub(n1, n0), n0))
            offset = contacts.offset[s, i, 0] + t1 * (contacts.offset[s, i, 1] - contacts.offset[s, i, 0])
            store(planes.normal[s], i, normal)
            store(planes.carried[s], i, scale(t1 - t0, away))
            planes.level[s, i] = dot(normal, axpy(t1, away, p0)) + offset
            reached = dot(normal, load(x, i)) + dot(normal, load(guess, i))
            touched = planes.force[s, i] > 0.0
            planes.pushing[s, i] = reached < planes.level[s, i] or touched
            if touched:
                slip = _along(normal, load(planes.slide[s], i))  # the plane has turned since
            else:  # it arrives: friction is against the way it comes
                slip = _along(normal, sub(load(guess, i), scale(t1 - t0, away)))
                planes.sliding[s, i] = True
            planes.sliding[s, i] &= norm(slip) > 0.0
            store(planes.slide[s], i, unit(slip))


@njit(cache=True, error_model="numpy")
def add_planes(planes, mass, h, x, y, matrix, right):
    """Add the planes that push to the system (blocks) d = right for the move d from y.

    Args:
        planes: Their stiffnesses are set here.
        mass: [kg], shape (V,).
        h: Step [s].
        x, y: Positions at the begin of the step and now [m], shape (V, 3).
        matrix: Changed in place.
        right: Forces [N], shape (V, 3), changed in place.
    """
    for s in range(len(planes.friction)):
        for i in range(len(x)):
            if not planes.pushing[s, i]:
                continue
            block = matrix.blocks[matrix.diagonal[i]]
            n, t = load(planes.normal[s], i), load(planes.slide[s], i)
            spring = (block[0, 0] + block[1, 1] + block[2, 2]) / 3.0 + _STIFFER * mass[i] / (h * h)
            hold = planes.friction[s] * planes.force[s, i]
            slip = _slip(planes, s, i, x, y)
            across = spring
            if planes.friction[s] == 0.0:
                across = 0.0
            elif planes.sliding[s, i]:
                length = norm(slip)
                across = hold / length if hold < spring * length else spring
                if hold == 0.0:
                    across = 0.0
            planes.spring[s, i], planes.across[s, i], planes.hold[s, i] = spring, across, hold
            gap = dot(n, load(y, i)) - planes.level[s, i]
            pull = axpy(-spring * gap, n, scale(-across, slip))
            along = 0.0
            if planes.sliding[s, i]:
                along = across
                pull = axpy(across * dot(slip, t) - hold, t, pull)
            store(right, i, axpy(1.0, pull, load(right, i)))
            for k in range(3):
                block[k, k] += across
                for m in range(3):
                    block[k, m] += (spring - across) * n[k] * n[m] - along * t[k] * t[m]


@njit(cache=True, error_model="numpy")
def keep_to_planes(planes, x, y, move):
    """Change a guess of the move from y so that planes that push are reached, and what holds does not slip.

    Args:
        planes: What pushes and what slides.
        x, y: Positions at the begin of the step and now [m], shape (V, 3).
        move: Changed in place [m], shape (V, 3).
    """
    for s in range(len(planes.friction)):
        for i in range(len(x)):
            if planes.pushing[s, i]:
                n = load(planes.normal[s], i)
                there = add(load(y, i), load(move, i))
                there = axpy(planes.level[s, i] - dot(n, there), n, there)
                if planes.friction[s] > 0.0 and not planes.sliding[s, i]:
                    slip = _along(n, sub(sub(there, load(x, i)), load(planes.carried[s], i)))
                    there = sub(there, slip)
                store(move, i, sub(there, load(y, i)))


@njit(cache=True, error_model="numpy")
def planes_energy(planes, x, y):
    """Return the energy of the springs, and the work against friction, at positions y after a step from x [J]."""
    energy = 0.0
    for s in range(len(planes.friction)):
        for i in range(len(x)):
            if planes.pushing[s, i]:
                gap = dot(load(planes.normal[s], i), load(y, i)) - planes.level[s, i]
                slip = _slip(planes, s, i, x, y)
                energy += 0.5 * planes.spring[s, i] * gap * gap
                if planes.sliding[s, i]:
                    along = dot(slip, load(planes.slide[s], i))
                    energy += planes.hold[s, i] * along - 0.5 * planes.across[s, i] * along * along
                energy += 0.5 * planes.across[s, i] * dot(slip, slip)
    return energy


@njit(cache=True, error_model="numpy")
def revise_planes(planes, x, y, allowed):
    """Put right which planes push and which slide, after a solution; note the forces.

    Args:
        planes: Changed in place.
        x, y: Positions at the begin and at the end of the step [m], shape (V, 3).
        allowed: How far a plane may be crossed without being taken on [m].

    Returns:
        The share of the touching planes that changed.
    """
    changed = touching = 0
    for s in range(len(planes.friction)):
        for i in range(len(y)):
            if not planes.there[s, i]:
                continue
            gap = dot(load(planes.normal[s], i), load(y, i)) - planes.level[s, i]
            if not planes.pushing[s, i]:
                if gap < 0.0:
                    planes.pushing[s, i] = True
                    changed += gap < -allowed
                continue
            touching += 1
            if gap > 0.0:
                planes.pushing[s, i] = planes.sliding[s, i] = False
                planes.force[s, i] = 0.0
                changed += gap > allowed
                continue
            arrived = planes.force[s, i] == 0.0
            planes.force[s, i] = -planes.spring[s, i] * gap
            if planes.friction[s] == 0.0:
                continue
            changed += arrived
            slip = _slip(planes, s, i, x, y)
            length = norm(slip)
            if planes.sliding[s, i]:
                planes.sliding[s, i] = dot(slip, load(planes.slide[s], i)) > 0.0
                changed += not planes.sliding[s, i]
            elif planes.spring[s, i] * length > planes.friction[s] * planes.force[s, i]:
                planes.sliding[s, i] = True
                changed += 1
            if planes.sliding[s, i]:
                store(planes.slide[s], i, scale(1.0 / length, slip))
    return changed / touching if touching > 0 else float(changed)


@njit(cache=True, error_model="numpy")
def _slip(planes, s, i, x, y):
    """Return how far vertex i moved along the plane, against the surface [m]."""
    moved = sub(sub(load(y, i), load(x, i)), load(planes.carried[s], i))
    return _along(load(planes.normal[s], i), moved)


@njit(cache=True, error_model="numpy")
def _along(normal, a):
    """Return the part of a along the plane."""
    return axpy(-dot(normal, a), normal, a)
