"""Uncertainty of measurements where the scan shows nothing and the model fills in."""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.report import CORE, EXPLAINED_M, extremity_weights
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar

_BENT_SHARE = 0.02
"""How much a measurement changes where a body is brought upright: skinning bends no flesh, it is our assumption."""


def unseen_sigmas(
    space: ShapeSpace, covariance: FloatArray, scan: Target, posed: FloatArray, body: Avatar, stands: bool
) -> dict[str, float]:
    """Return name -> standard uncertainty from the parts that the scan does not show [m, kg].

    Where nothing is seen, the surface is the model's: it errs as the shape's parameters do, and by as much as the model
    had to be displaced where something is seen, all in one direction.

    Args:
        space: The shape space.
        covariance: Of the shape's parameters after the fit, shape (P, P).
        scan: What the body was fitted to.
        posed: The model before its displacement [m], shape (V, 3).
        body: After it.
        stands: Whether the scan stands as the body is measured; what was bent is measured less surely.
    """
    away = closest_points(body.vertices, scan.vertices, scan.faces)[2]
    unseen = away > EXPLAINED_M
    shown = ~unseen & (extremity_weights(space.base) < CORE)
    misfit = float(np.sqrt((np.linalg.norm(body.vertices - posed, axis=1)[shown] ** 2).mean())) if shown.any() else 0.0
    tape, sigmas = Tape(body), {}
    for name, what in DEFINITIONS.items():
        slope, pull = np.zeros(len(space.names)), 0.0
        for side in ("left", "right"):
            reading = tape.read(what, body.bind_vertices, side)
            gradient = 0.5 * reading.gradient * unseen[reading.vertices, None]
            slope += np.einsum("nk,pnk->p", gradient, space.fields[:, reading.vertices])
            pull += float(np.linalg.norm(gradient, axis=1).sum())
        straightened = 0.0 if stands else _BENT_SHARE * tape.read(what, body.bind_vertices).value
        sigmas[name] = float(np.sqrt(slope @ covariance @ slope + (pull * misfit) ** 2 + straightened**2))
    return sigmas
