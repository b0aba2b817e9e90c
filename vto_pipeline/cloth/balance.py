"""How far a cloth is from equilibrium, whatever path it came by."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.build import ClothModel
from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.vector import axpy, dot, load, norm, scale, store, sub
from vto_pipeline.units import GRAVITY

_TOUCHING = 1e-4  # m: nearer to its plane than this, a vertex may be held by it


def out_of_balance(model: ClothModel, positions: FloatArray, contacts: Contacts) -> float:
    """Return the left-over force, rms over the free vertices, as a share of a vertex's weight.

    Internal forces and gravity, less what contact can bear: the push along the normal, and friction inside its cone.

    Args:
        model: The cloth.
        positions: [m], shape (V, 3).
        contacts: Planes, taken at the end of their span.
    """
    forces = model.mass[:, None] * model.gravity
    add_forces(positions, model.constraints, forces)
    _bear(forces, positions, contacts)
    free = model.inverse_mass > 0.0
    if not free.any():
        return 0.0
    share = np.linalg.norm(forces[free], axis=1) / (model.mass[free] * GRAVITY)
    return float(np.sqrt(np.mean(share**2)))


def elastic_energy(model: ClothModel, positions: FloatArray) -> float:
    """Return the energy stored in the cloth [J]."""
    return float(add_forces(positions, model.constraints, np.zeros_like(positions)))


@njit(cache=True)
def _bear(forces, positions, contacts):  # type: ignore[no-untyped-def]
    """Take from each force what its contacts can hold, in place."""
    for i in range(len(forces)):
        f = load(forces, i)
        for s in range(len(contacts.friction)):
            if not contacts.active[s, i]:
                continue
            n = load(contacts.normal[s, i], 1)
            gap = dot(n, sub(load(positions, i), load(contacts.point[s, i], 1))) - contacts.offset[s, i, 1]
            push = -dot(f, n)
            if gap > _TOUCHING or push <= 0.0:
                continue
            f = axpy(push, n, f)
            along, hold = norm(f), contacts.friction[s] * push
            f = scale(1.0 - hold / along, f) if along > hold else (0.0, 0.0, 0.0)
        store(forces, i, f)
