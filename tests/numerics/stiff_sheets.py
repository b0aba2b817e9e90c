"""Matrices such as an implicit step of a sheet has: mass and stiffness, without the cloth."""

import numpy as np
from scipy import sparse

from vto_pipeline.numerics.linear.block_matrix import pattern
from vto_pipeline.numerics.linear.multigrid import hierarchy, update_hierarchy


def grid_edges(side, first=0):
    """Edges of a square grid, its vertices numbered from `first`."""
    number = first + np.arange(side * side).reshape(side, side)
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:]), (number[:-1, :-1], number[1:, 1:])]
    return np.vstack([np.column_stack([a.ravel(), b.ravel()]) for a, b in pairs]).astype(np.int32)


def levels_of(edges, count, held=(), *, mass=1e-3, seed=0):
    """Return a hierarchy with the matrix of m I + springs of stiffness about 1 along the edges, and held rows."""
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    fixed = np.zeros(count, bool)
    fixed[list(held)] = True
    matrix, places = pattern(rows, columns, count)
    levels = hierarchy(matrix, fixed)
    blocks = levels.matrix.blocks[: len(matrix.blocks)]
    blocks[matrix.diagonal] = mass * np.eye(3)
    roots = np.random.default_rng(seed).normal(size=(len(edges), 3, 3))
    springs = np.eye(3) + 0.3 * roots @ roots.transpose(0, 2, 1)
    for (a, b), place, back, spring in zip(edges, places, places[len(edges) :], springs, strict=False):
        for vertex in (a, b):
            if not fixed[vertex]:
                blocks[matrix.diagonal[vertex]] += spring
        if not (fixed[a] or fixed[b]):
            blocks[place] -= spring
            blocks[back] -= spring
    blocks[matrix.diagonal[fixed]] = np.eye(3)
    update_hierarchy(levels)
    return levels


def level_matrix(levels, level):
    """The matrix of one level, for SciPy."""
    matrix, (first, end) = levels.matrix, levels.rows[level : level + 2]
    begin, stop = levels.slots[level : level + 2]
    starts = np.append(matrix.starts[first:end], stop) - begin
    shape = (3 * (end - first),) * 2
    return sparse.bsr_array((matrix.blocks[begin:stop], matrix.columns[begin:stop] - first, starts), shape=shape)


def interpolation(levels, level):
    """From level + 1 to level, for each of the three directions alike."""
    first, end, stop = levels.rows[level : level + 3]
    starts = levels.up.starts[first : end + 1]
    inside = slice(starts[0], starts[-1])
    weights, columns = levels.up.weights[inside], levels.up.columns[inside] - end
    scalar = sparse.csr_array((weights, columns, starts - starts[0]), shape=(end - first, stop - end))
    return sparse.kron(scalar, sparse.eye_array(3), format="csr")
