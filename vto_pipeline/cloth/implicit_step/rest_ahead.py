"""How far rest is: one long Newton step with the exact stiffness, which is looked at and not taken.

Where cloth is about to buckle there is no such step. But what buckles is mostly a few vertices of one wrinkle. So along
each direction of negative curvature that the solution meets, springs hold back the vertices that bear it, as Levenberg
1944 does everywhere. The solution then says how far all others have to go.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.response.active_set import ActiveSet
from vto_pipeline.cloth.collision.response.contact_springs import add_contacts, linked_contacts
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.implicit_step.lacking import complete, times_lacking
from vto_pipeline.cloth.implicit_step.linear_system import LinearSystem
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray

_DIRECTIONS = 8  # at most: what buckles in more of them is not known at all
_BEARS = 0.01  # of the largest squared part of a direction: what has less is only led along
_FIRMER = 1.5  # times what curvature lacks


class RestAhead(NamedTuple):
    """Where cloth would come to rest, were all contacts to stay as they are.

    Args:
        move: Until no force is left [m], shape (V, 3).
        unstable: Vertices about to buckle, for which that is not known, shape (V,).
    """

    move: FloatArray
    unstable: NDArray[np.bool_]


def rest_ahead(
    model: ClothModel,
    stiffness: Stiffness,
    system: LinearSystem,
    held: NDArray[np.bool_],
    active: ActiveSet,
    x: FloatArray,
    h: float,
) -> RestAhead | None:
    """Return where cloth at x would come to rest, as far as its exact stiffness tells.

    Args:
        model: The cloth.
        stiffness, system: Of its steps; the system is written over.
        held: Vertices that do not move, shape (V,).
        active: Contacts at x.
        x: Positions [m], shape (V, 3).
        h: Time that it has, from standing still [s]: as long as inertia is to hold nothing back.

    Returns:
        None where that is not known: the factored part is not positive definite, or too much buckles.
    """
    matrix = stiffness.assemble_exact(x, 1.0 / (h * h), 1.0 / h)
    system.uncouple()
    right = model.mass[:, None] * model.gravity
    add_forces(x, model.constraints, right)
    right[held] = 0.0
    if len(active.key) > 0:
        between = system.couple(*linked_contacts(active, held))
        add_contacts(active, model.mass, held, h, x, x, matrix, right, between, True)
    move, springs = np.zeros_like(x), np.zeros(len(x))

    def lacking(way: FloatArray) -> FloatArray:
        return times_lacking(model.constraints, held, x, h, way) + springs[:, None] * way

    if not system.eliminated(right, move):
        return None
    for _ in range(_DIRECTIONS):
        buckling = complete(move, right, system.substitute, lacking)
        if buckling is None:
            return RestAhead(move, springs > 0.0)
        size = (buckling.direction**2).sum(axis=1)
        bears = size > _BEARS * size.max()
        more = springs[bears] - _FIRMER * buckling.curvature / size[bears].sum()
        springs[bears] = np.maximum(2.0 * springs[bears], more)
        move = system.substitute(right)
    return None
