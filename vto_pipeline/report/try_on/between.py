"""Shapes between those of a grid, multilinear in its values, and how wrong they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def left_out(places: FloatArray, axes: Sequence[Sequence[float]]) -> FloatArray:
    """Return how far interpolation misses the shapes that were made, each left out in its turn.

    A shape between two neighbours is compared with what these give: the grid is half as fine there. Where shapes change
    smoothly, interpolation in the whole grid is four times as good. Where cloth has several ways to fold, it is not.

    Args:
        places: Of all vertices [m], shape (number of values on each axis..., V, 3).
        axes: The values, the smallest first.

    Returns:
        Distances [m], shape (N, V): a row for each shape and axis along which it has neighbours on both sides.
    """
    found = [np.empty((0, places.shape[-2]))]
    for number, values in enumerate(axes):
        along = np.moveaxis(places, number, 0)
        for k in range(1, len(values) - 1):
            share = (values[k] - values[k - 1]) / (values[k + 1] - values[k - 1])
            guess = (1.0 - share) * along[k - 1] + share * along[k + 1]
            found.append(np.linalg.norm(guess - along[k], axis=-1).reshape(-1, places.shape[-2]))
    return np.concatenate(found)


def midway(places: FloatArray) -> Iterator[FloatArray]:
    """Yield the shapes in the middle of the cells of a grid [m], shape (V, 3) each.

    Args:
        places: As for `left_out`.
    """
    counts = places.shape[:-2]
    for cell in product(*(range(max(count - 1, 1)) for count in counts)):
        corners = tuple(slice(first, first + 2) for first in cell)
        yield places[corners].reshape(-1, *places.shape[-2:]).mean(axis=0)


def deepest_inside(garment: FloatArray, body: FloatArray, faces: np.ndarray) -> float:
    """Return how deep cloth gets into the body midway between drapes [m]; 0 where it stays outside.

    Args:
        garment: Of all its vertices [m], as for `left_out`.
        body: Likewise.
        faces: Of the body, shape (F, 3).
    """
    deepest = 0.0
    for cloth, skin in zip(midway(garment), midway(body), strict=True):
        distance = SurfaceDistance(TriangleMesh(skin, faces)).signed(cloth).distance
        deepest = max(deepest, -float(distance.min(initial=0.0)))
    return deepest
