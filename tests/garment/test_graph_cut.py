"""The cut against all divisions there are."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.garment.subtraction.color_model import cielab, color_evidence
from vto_pipeline.garment.subtraction.graph_cut import minimum_cut


def energy(label, unary, edges, pairwise):
    wrong = np.where(label, np.maximum(-unary, 0.0), np.maximum(unary, 0.0)).sum()
    return wrong + pairwise[label[edges[:, 0]] != label[edges[:, 1]]].sum()


@pytest.mark.parametrize("seed", range(30))
def test_no_division_is_cheaper(seed):
    rng = np.random.default_rng(seed)
    count = 9
    unary = rng.normal(0, 1.5, count)
    edges = np.array([(i, j) for i in range(count) for j in range(i) if rng.random() < 0.4])
    pairwise = rng.uniform(0, 2, len(edges))
    best = min(energy(np.array(label), unary, edges, pairwise) for label in product([False, True], repeat=count))
    found = energy(minimum_cut(unary, edges, pairwise), unary, edges, pairwise)
    assert_allclose(found, best, atol=count * 1e-4)  # whole-number capacities of 1e-4


def test_prices_bring_lone_dissenters_round_and_free_edges_do_not():
    unary = np.array([3.0, 3.0, -1.0, 3.0, -3.0, -3.0])
    chain = np.column_stack([np.arange(5), np.arange(1, 6)])
    assert minimum_cut(unary, chain, np.ones(5)).tolist() == [True] * 4 + [False] * 2
    assert minimum_cut(unary, chain, np.zeros(5)).tolist() == (unary > 0).tolist()


def test_lab_of_known_colours():
    found = cielab(np.array([[255, 255, 255], [0, 0, 0], [255, 0, 0], [0, 0, 255]], dtype=np.uint8))
    wanted = [[100, 0, 0], [0, 0, 0], [53.24, 80.09, 67.20], [32.30, 79.19, -107.86]]
    assert_allclose(found, wanted, atol=0.05)  # four-digit matrix


def test_colour_speaks_for_its_own_material():
    rng = np.random.default_rng(0)
    blue = np.clip(rng.normal([60, 90, 160], 8, (500, 3)), 0, 255).astype(np.uint8)
    beige = np.clip(rng.normal([205, 190, 170], 8, (500, 3)), 0, 255).astype(np.uint8)
    green = np.tile(np.uint8([30, 200, 60]), (10, 1))
    colors = np.vstack([blue, beige, green])
    known = np.arange(1010)
    said = color_evidence(colors, (known < 400), (known >= 500) & (known < 900))
    assert said[400:500].min() > 1.0
    assert said[900:1000].max() < -1.0
    assert_allclose(said[1000:], 0.0, atol=1e-6)  # a colour of neither says nothing
