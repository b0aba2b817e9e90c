"""The last pass of a drape: no triangle of the cloth may cross the body.

Contacts are held at the vertices; between them a triangle can still cut a sharp bump. Where one does, the skin of the
vertices around it thickens, by as much as the triangle lies in the body, and the cloth relaxes, until none is left. The
skin stays as it is: it is part of the equilibrium.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.build import ClothState
from vto_pipeline.cloth.stepper import Stepper
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_THICKEN = 1e-3  # m a round, at least
_SHARPEST = 0.25  # of a triangle's longest edge: a bump no sharper than the triangle is long reaches in no deeper
_ALONG = 4  # parts of a triangle's edges between the points that are asked how deep they are
_RELAX = 0.1  # s of cloth time a round
_PATIENCE = 5  # rounds without fewer crossings: what passes through a limb does so however thick the skin


def clear_of_body(
    stepper: Stepper, state: ClothState, faces: IntArray, body: TriangleMesh, rounds: int
) -> tuple[ClothState, IntArray]:
    """Thicken and relax until no triangle of the cloth meets the body, the rounds are spent, or bring nothing.

    Args:
        stepper: The cloth among its colliders; its skin is raised.
        state: The cloth.
        faces: Its triangles, shape (F, 3).
        body: Where the body is now.
        rounds: How often to try.

    Returns:
        The state, and the pairs (cloth face, body face) still meeting, shape (K, 2).
    """
    pairs = intersecting_faces(TriangleMesh(state.positions, faces), body)
    fewest, since = len(pairs), 0
    for _ in range(rounds):
        if len(pairs) == 0 or since == _PATIENCE:
            break
        crossing = faces[np.unique(pairs[:, 0])]
        more = np.zeros(len(stepper.skin))
        np.maximum.at(more, crossing, np.maximum(_lacking(state.positions[crossing], body), _THICKEN)[:, None])
        stepper.skin += more
        state = stepper.run(state, _RELAX)
        pairs = intersecting_faces(TriangleMesh(state.positions, faces), body)
        fewest, since = min(fewest, len(pairs)), 0 if len(pairs) < fewest else since + 1
    return state, pairs


def _lacking(corners: FloatArray, body: TriangleMesh) -> FloatArray:
    """Return how deep triangles reach into the body, as far as that may be cleared at once [m], shape (N,).

    Args:
        corners: [m], shape (N, 3, 3).
        body: Where it is now.
    """
    weights = np.array([(i, j, _ALONG - i - j) for i in range(_ALONG + 1) for j in range(_ALONG + 1 - i)]) / _ALONG
    points = np.einsum("pk,nkd->npd", weights, corners)
    deepest = -SurfaceDistance(body).signed(points.reshape(-1, 3)).distance.reshape(len(corners), -1).min(axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return np.minimum(deepest, _SHARPEST * longest)
