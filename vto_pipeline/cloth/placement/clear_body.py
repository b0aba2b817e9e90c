"""The last pass of a drape: no triangle of the cloth may cross the body.

Contacts are held at the vertices; between them a triangle can still cut a sharp bump. Where one does, the skin of the
vertices around it thickens and the cloth relaxes, until none is left. These vertices slide meanwhile: held by friction
on the flanks of the bump, the triangle over its top would be stretched between them, and no cloth has rubbed there. The
skin stays as it is: it is part of the equilibrium.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_THICKEN = 1e-3  # m a round at least,
_FASTER = 0.15  # and this share of the skin: cloth stretched to triangles of several times their size needs much
_RELAX = 0.1  # s of cloth time a round
OVERSTRETCHED = 2.0
"""Length of an edge, times that at rest, from which on cloth that passes through a body is caught in it."""

_PATIENCE = 5  # rounds without fewer crossings: what passes through a limb does so however thick the skin


def clear_body_crossings(
    stepper: Stepper, state: ClothState, rest: FloatArray, faces: IntArray, body: TriangleMesh, rounds: int
) -> tuple[ClothState, IntArray]:
    """Thicken and relax until no triangle of the cloth crosses the body, or no progress is made.

    Cloth so soft that nothing but friction holds it up would flow down the body: what sliding does not clear is tried
    once more with friction. What is caught, so that a thicker skin only stretches it, is left as it was.

    Args:
        stepper: The cloth among its colliders; its skin is raised, and friction as it was at the end.
        state: The cloth.
        rest: Its shape without forces [m], shape (V, 3).
        faces: Its triangles, shape (F, 3).
        body: Where the body is now.
        rounds: How often to try.

    Returns:
        The state, and the pairs (cloth face, body face) still meeting, shape (K, 2).
    """
    skin, known = stepper.skin.copy(), stepper.contact_memory
    cleared, pairs = _thicken(stepper, state, rest, faces, body, rounds, slides=True)
    if len(pairs) > 0 and rounds > 0:
        stepper.skin, stepper.contact_memory = skin, known
        cleared, pairs = _thicken(stepper, state, rest, faces, body, rounds, slides=False)
    return cleared, pairs


def edge_stretches(positions: FloatArray, rest: FloatArray, faces: IntArray) -> FloatArray:
    """Return the length of each side of the faces as a multiple of that at rest, 0 where that is none, shape (F, 3).

    Args:
        positions, rest: [m], shape (V, 3).
        faces: Shape (F, 3).
    """
    now, before = (np.linalg.norm(x[faces] - np.roll(x[faces], 1, axis=1), axis=2) for x in (positions, rest))
    return np.divide(now, before, out=np.zeros_like(now), where=before > 0.0)


def _thicken(
    stepper: Stepper,
    state: ClothState,
    rest: FloatArray,
    faces: IntArray,
    body: TriangleMesh,
    rounds: int,
    *,
    slides: bool,
) -> tuple[ClothState, IntArray]:
    """Return the state after thickening, and what still meets; as it began, where all that grows is the stretch."""
    pairs = intersecting_faces(TriangleMesh(state.positions, faces), body)
    begin, skin, known = (state, pairs), stepper.skin.copy(), stepper.contact_memory
    most = (
        OVERSTRETCHED * max(1.0, edge_stretches(state.positions, rest, faces).max(initial=0.0))
        if len(pairs) > 0
        else np.inf
    )
    fewest, since = len(pairs), 0
    for _ in range(rounds):
        if len(pairs) == 0 or since == _PATIENCE:
            break
        about = np.unique(faces[pairs[:, 0]])
        stepper.skin[about] += np.maximum(_THICKEN, _FASTER * stepper.skin[about])
        stepper.loose[about] = slides
        state = stepper.run(state, _RELAX)
        pairs = intersecting_faces(TriangleMesh(state.positions, faces), body)
        if len(pairs) > 0 and edge_stretches(state.positions, rest, faces).max(initial=0.0) > most:
            (state, pairs), stepper.skin, stepper.contact_memory = begin, skin, known
            break
        fewest, since = min(fewest, len(pairs)), 0 if len(pairs) < fewest else since + 1
    stepper.loose[:] = False
    return state, pairs
