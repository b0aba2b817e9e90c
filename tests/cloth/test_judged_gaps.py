"""The judge's gaps between faces of a cloth: also of those that share corners."""

from itertools import product

import numpy as np
import pytest
from cloth_scenes import moved, sheet
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from vto_pipeline.cloth.judge.gap import gaps_within


def features_apart(x, one, two):
    """The least distance of corners from faces they lie over and of edges that share no corner, by least squares."""
    edges = [[(f[k], f[(k + 1) % 3]) for k in range(3)] for f in (one, two)]
    found = []
    for (a, b), (c, d) in product(*edges):
        if not {a, b} & {c, d}:
            solved = lsq_linear(np.column_stack([x[b] - x[a], x[c] - x[d]]), x[c] - x[a], (0, 1), tol=1e-14)
            found.append(np.sqrt(2 * solved.cost))
    for corner, (a, b, c) in [(i, two) for i in one] + [(i, one) for i in two]:
        if corner not in (a, b, c):
            shares, cost, _, _ = np.linalg.lstsq(np.column_stack([x[b] - x[a], x[c] - x[a]]), x[corner] - x[a])
            if shares.min() >= 0.0 and shares.sum() <= 1.0:
                found.append(np.sqrt(cost[0]))
    return min(found)


@pytest.mark.parametrize("shared", [0, 1, 2])
def test_faces_that_share_corners_have_a_gap_where_they_are_folded_onto_each_other(shared):
    rng, seen = np.random.default_rng(shared), 0
    faces = np.array([[0, 1, 2], [[3, 4, 5], [2, 3, 4], [2, 1, 3]][shared]], np.int32)
    for _ in range(200):
        rest, x = rng.normal(size=(6, 3)), rng.normal(size=(6, 3)) * [1, 1, 0.1]
        pairs, gaps = gaps_within(x, rest, faces, 1.0)
        now, laid = features_apart(x, *faces), features_apart(rest, *faces)
        size = min(np.linalg.norm(x[face] - x[face].mean(axis=0), axis=1).max() for face in faces)
        assert (len(pairs) == 1) == (now < min(max(0.5 * laid, 0.25 * size), 1.0))
        if len(pairs):
            assert_allclose(gaps, now, rtol=0, atol=1e-6)
            seen += 1
    assert 20 < seen < 180


def test_layers_that_touch_at_rest_have_a_gap_and_a_flat_sheet_has_none():
    one = sheet(9, 9, 0.2, 0.2, upright=False)
    other = moved(one, 0.013, 1e-3, 0.007)
    both = np.vstack([one.vertices, other.vertices])
    _, gaps = gaps_within(both, both, np.vstack([one.faces, other.faces + 81]), 5e-3)
    assert_allclose(gaps.min(), 1e-3, rtol=1e-9)
    shrunk = 0.15 * one.vertices  # all nearer than looked for
    assert len(gaps_within(shrunk, shrunk, one.faces, 5e-3)[0]) == 0
