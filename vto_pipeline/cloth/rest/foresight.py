"""How far cloth that hardly moves is from rest, by its exact stiffness: small moves alone tell little.

Cloth about to buckle hardly moves for long, and then far. Its stiffness is not positive definite there. Elsewhere a
Newton step with the contacts of now says how far rest is, but for what contacts will change.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np

from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.cloth.rest.stable_newton import LONGEST
from vto_pipeline.model.arrays import FloatArray

VAGUE = 3e-3
"""m: what is not known to be stable may still buckle by as much, as dresses of `vto bench drape` do."""

_FROZEN = 3.0  # times that step: contacts that change and slip take it 2 to 4 times as far
_LOOKS = 5  # from one such step to the next: each costs half as much as a look


class Foresight:
    """What is asked now and then of a cloth on its way to rest: what of it is stable, and how far it has to go.

    Args:
        stepper: The cloth among its colliders, prepared.
    """

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        self._error = VAGUE
        self._looks = _LOOKS

    def error(self, state: ClothState, to_come: float, *, ends: bool) -> float:
        """Return the predicted distance to the state of rest, rms over vertices [m].

        Args:
            state: Now.
            to_come: By its moves [m].
            ends: Whether it is at rest by all else.
        """
        self._looks += 1
        if to_come < VAGUE and (ends or self._looks > _LOOKS):
            self._error = self._foreseen(state)
            self._looks = 0
        return max(to_come, self._error)

    def _foreseen(self, state: ClothState) -> float:
        ahead = self._stepper.rest_ahead(state, LONGEST)
        if ahead is None:
            return VAGUE
        return min(hypot(_FROZEN * rms(ahead.move), VAGUE * sqrt(ahead.unstable.mean())), VAGUE)


def rms(moves: FloatArray) -> float:
    """Return the root mean square length of these vectors, shape (V, 3) [m]."""
    return float(np.sqrt((moves**2).sum(axis=1).mean()))
