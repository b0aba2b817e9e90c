"""Noise along a line that neighbours share: how much of it, and over which length, from what a fit leaves over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from vto_pipeline.model.arrays import FloatArray

_SHARED = (0.0, 0.3, 0.6, 0.85, 0.97)
_LEAST = 1e-10  # variance: a micrometre in a strip of 100 mm
_NOT_RULED_OUT = 1.92  # of log likelihood: half of the 95 % quantile of χ² with one degree of freedom
_REACH = (0.02, 0.04, 0.08, 0.16, 0.32)
"""Share of the variance that neighbours have in common, and its length by that of the whole line."""


@dataclass(frozen=True)
class Noise:
    """What is known of the noise.

    Args:
        whitening: Of the most likely noise, shape (N, N): residuals times it are independent, with unit variance.
        covariance: Of the fitted parameters, shape (P, P): of all noises that the residuals do not rule out, the one
            that leaves the first parameter least certain.
    """

    whitening: FloatArray
    covariance: FloatArray


def explain(residuals: FloatArray, slopes: FloatArray, prior: FloatArray, places: Sequence[FloatArray]) -> Noise:
    """Return the noise in residuals of a fit, by restricted maximum likelihood, with exponential correlation.

    The likelihood takes off what the fitted parameters have swallowed (Patterson & Thompson 1971). Noise of
    long reach looks like a shape and leaves few traces, so the covariance is the widest that the residuals allow.

    Args:
        residuals: Shape (N,).
        slopes: Their derivatives by the parameters, shape (N, P).
        prior: Precision of the parameters before, in units of the parameters alone, shape (P, P).
        places: Of the points of each line along it, by its length; N in all.
    """
    free = len(residuals) - slopes.shape[1]
    apart = [np.abs(at[:, None] - at) for at in places]
    scores, found = [], []
    for shared in _SHARED:
        for reach in _REACH if shared else _REACH[:1]:
            blocks = [(1.0 - shared) * np.eye(len(d)) + shared * np.exp(-d / reach) for d in apart]
            roots = [np.linalg.cholesky(block) for block in blocks]
            white = block_diag(*(solve_triangular(root, np.eye(len(root)), lower=True) for root in roots))
            r, j = white @ residuals, white @ slopes
            variance = float(r @ r) / free + _LEAST
            for _ in range(3):  # the prior has units, the likelihood has none
                precision = j.T @ j + variance * prior
                left = r - j @ np.linalg.solve(precision, j.T @ r)
                variance = float(left @ left) / free + _LEAST
            scale = sum(np.log(np.diag(root)).sum() for root in roots)
            scores.append(-scale - 0.5 * np.linalg.slogdet(precision)[1] - 0.5 * free * np.log(variance))
            found.append((white, variance, precision))
    likely = int(np.argmax(scores))
    white, variance, _ = found[likely]
    allowed = [
        own * np.linalg.inv(precision)
        for (_, own, precision), score in zip(found, scores, strict=True)
        if score > scores[likely] - _NOT_RULED_OUT
    ]
    return Noise(white / np.sqrt(variance), max(allowed, key=lambda covariance: float(covariance[0, 0])))
