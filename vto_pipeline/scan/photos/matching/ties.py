"""How firmly photos are tied to each other by the points that they share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

LEAST_TIES = 30
"""Photos that fewer points tie to the others may be anywhere: so few agree by chance, or on a repeat of the print, and
then to a fraction of a pixel. COLMAP's incremental mapper demands as many of each photo; the global one, none."""

LEAST_LINK = 10
"""Two parts that one photo connects have no common scale: each may be of any size about that photo. Links
besides it fix the scale; each is between photos that share so many points."""


def untie(model: Any, sure: Sequence[int] = ()) -> Any:
    """Leave out of a pycolmap Reconstruction, in place, the photos that too few points tie to most of the others.

    Args:
        model: Placed photos and sparse points.
        sure: Numbers of photos that see the same board: it ties them as points enough would.

    Returns:
        The model.
    """
    while True:
        ids = sorted(number for number, image in model.images.items() if image.has_pose)
        place = {number: index for index, number in enumerate(ids)}
        sightings = [
            (row, place[element.image_id])
            for row, point in enumerate(model.points3D.values())
            for element in point.track.elements
        ]
        board = [
            (len(model.points3D) + k, place[number]) for k in range(LEAST_TIES) for number in sure if number in place
        ]
        seen = np.array(sightings + board, dtype=np.int64).reshape(-1, 2)
        kept = tied_together(seen[:, 0], seen[:, 1], len(ids))
        if kept.all():
            return model
        for number in np.array(ids)[~kept]:
            model.deregister_frame(model.images[int(number)].frame_id)


def tied_together(point: NDArray[np.int64], photo: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    """Return which photos belong to the largest group that is tied together, shape (count,).

    The photos are joined by a tree of their strongest ties, those that share most points. It is cut where the points
    seen on both sides of the cut are too few. Of what is left, no two parts may be connected by one photo alone.

    Args:
        point, photo: Of each sighting, shape (S,).
        count: Number of photos.
    """
    if count == 0 or len(point) == 0:
        return np.zeros(count, dtype=bool)
    once = csr_matrix((np.ones(len(point)), (point, photo)), (int(point.max()) + 1, count))
    once.data[:] = 1.0  # a photo sees a point once
    shared = (once.T @ once).toarray()
    np.fill_diagonal(shared, 0.0)
    tree = minimum_spanning_tree(csr_matrix(np.where(shared > 0.0, 1.0 / np.maximum(shared, 1.0), 0.0))).tolil()
    viewers = np.asarray(once.sum(axis=1)).ravel()
    weak = []
    for a, b in zip(*tree.nonzero(), strict=True):
        strength, tree[a, b] = tree[a, b], 0.0
        _, side = connected_components(tree.tocsr(), directed=False)
        tree[a, b] = strength
        here = once @ (side == side[a]).astype(float)
        if np.count_nonzero((here > 0.0) & (here < viewers)) < LEAST_TIES:
            weak.append((a, b))
    for a, b in weak:
        tree[a, b] = 0.0
    return _of_one_scale(_largest(tree.tocsr()), shared >= LEAST_LINK)


def _of_one_scale(group: NDArray[np.bool_], linked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the part of a group (C,) that stays connected by its links (C, C) without any one of its photos."""
    group = group.copy()
    for hinge in np.flatnonzero(group):
        rest = np.flatnonzero(group & (np.arange(len(group)) != hinge))
        if group[hinge] and len(rest) > 1:
            group[rest] = _largest(csr_matrix(linked[np.ix_(rest, rest)]))
    return group


def _largest(graph: csr_matrix) -> NDArray[np.bool_]:
    """Return which nodes belong to the largest connected piece of a graph, shape (C,)."""
    _, piece = connected_components(graph, directed=False)
    return np.asarray(piece == int(np.argmax(np.bincount(piece))), dtype=bool)
