"""Exact conservation of momentum of free pieces, despite rounding in linear solvers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.points.combination import Combination, holds_to_place
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix


class ClothComponents(NamedTuple):
    """Connected pieces of the cloth.

    Args:
        of: The piece of each vertex, shape (V,).
        held: Whether a held vertex or an attachment holds a piece, shape (P,).
    """

    of: NDArray[np.int32]
    held: NDArray[np.bool_]


def free_components(model: ClothModel, matrix: BlockMatrix) -> ClothComponents | None:
    """Return the pieces of a cloth, of whose stiffness this is the pattern; None if all are held somewhere."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    held = model.inverse_mass == 0.0
    for data in model.constraints:
        if isinstance(data, Combination):
            held[data.vertices[holds_to_place(data)]] = True
    count = len(held)
    ones = np.ones(len(matrix.columns), np.int8)
    of = connected_components(csr_array((ones, matrix.columns, matrix.starts), shape=(count, count)))[1]
    pinned = np.bincount(of, held) > 0
    return None if pinned.all() else ClothComponents(of, pinned)


@njit(cache=True, error_model="numpy")
def keep_momentum(components, contacts, mass, move, wanted):
    """Shift pieces that nothing holds so that their mean moves are the wanted ones; those that push each other as one.

    Args:
        components: Of the cloth.
        contacts: An active set; a place that is touched holds, another piece does not.
        mass: [kg], shape (V,).
        move: Changed in place [m], shape (V, 3).
        wanted: [m], shape (V, 3).
    """
    root = np.arange(len(components.held))
    held = components.held.copy()
    for c in range(len(contacts.key)):
        if not contacts.pushing[c]:
            continue
        one, total = _root(root, components.of[contacts.vertices[c, 0]]), 0.0
        for s in range(contacts.vertices.shape[1]):
            if contacts.weights[c, s] != 0.0:
                other = _root(root, components.of[contacts.vertices[c, s]])
                total += contacts.weights[c, s]
                held[one] = held[one] or held[other]
                root[other] = one
        held[one] = held[one] or abs(total) > 0.5  # weights sum to one before a place, to zero between two
    missing = np.zeros((len(held), 4))
    for i in range(len(move)):
        p = _root(root, components.of[i])
        if not held[p]:
            missing[p, 3] += mass[i]
            for k in range(3):
                missing[p, k] += mass[i] * (wanted[i, k] - move[i, k])
    for i in range(len(move)):
        p = _root(root, components.of[i])
        if not held[p] and missing[p, 3] > 0.0:
            for k in range(3):
                move[i, k] += missing[p, k] / missing[p, 3]


@njit(cache=True, error_model="numpy")
def _root(root, p):
    while root[p] != p:
        root[p] = root[root[p]]
        p = root[p]
    return p
