"""Matches of descriptors against a search by full sorting; along lines that are known; and confirmed by a third."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vto_pipeline.scan.photos.matching.guided import confirmed
from vto_pipeline.scan.photos.matching.nearest import BLOCK, Lines, nearest_matches


def descriptors(count, seed):
    """Gradients are mostly small, a few are large: as of SIFT, of length 512 to rounding."""
    some = np.random.default_rng(seed).gamma(0.6, 1.0, (count, 128))
    return np.rint(512 * some / np.linalg.norm(some, axis=1, keepdims=True)).clip(0, 255).astype(np.float32)


def seen_again(first, share, seed, noise=6.0):
    """The features of another photo: some of the first one's, disturbed, among others, in another order."""
    random = np.random.default_rng(seed)
    known = random.permutation(len(first))[: int(share * len(first))]
    disturbed = np.abs(first[known] + random.normal(0, noise, (len(known), 128)))
    disturbed = np.rint(512 * disturbed / np.linalg.norm(disturbed, axis=1, keepdims=True)).clip(0, 255)
    both = np.vstack([disturbed, descriptors(len(first) // 2, seed + 1)])
    order = random.permutation(len(both))
    return both[order].astype(np.float32), np.concatenate([known, np.full(len(both) - len(known), -1)])[order]


def by_sorting(first, second, allowed):
    """Pairs that pass Lowe's test at 0.8 and lie within 0.7 rad, from both sides, by all products in whole numbers."""
    products = np.where(allowed, first.astype(np.int64) @ second.astype(np.int64).T, 0)

    def clear(rows):
        order = np.argsort(-rows, axis=1, kind="stable")
        best, other = (np.take_along_axis(rows, order[:, k : k + 1], 1)[:, 0] for k in (0, 1))
        angle, next_angle = (np.arccos(np.minimum(one / 512.0**2, 1.0)) for one in (best, other))
        return np.where((best > 0) & (angle < 0.7) & (angle < 0.8 * next_angle), order[:, 0], -1)

    ahead, back = clear(products), clear(products.T)
    return np.array([(i, k) for i, k in enumerate(ahead) if k >= 0 and back[k] == i]).reshape(-1, 2)


@pytest.mark.parametrize("count", [3, 200, BLOCK + 300])
def test_matches_are_those_of_a_full_search(count):
    first = descriptors(count, 1)
    second, source = seen_again(first, 0.7, 2)
    found = nearest_matches(first, second)
    assert_array_equal(found, by_sorting(first, second, np.ones((len(first), len(second)), bool)))
    assert (source[found[:, 1]] == found[:, 0]).mean() > 0.98
    assert len(found) > 0.5 * count


def test_one_of_two_alike_is_no_match():
    first = descriptors(50, 3)
    second = np.vstack([first, first[:20]])
    assert_array_equal(nearest_matches(first, second), [(k, k) for k in range(20, 50)])
    assert_array_equal(nearest_matches(second, first), [(k, k) for k in range(20, 50)])


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_one_that_is_hardly_nearer_than_another_is_no_match_in_whatever_order(order):
    first = descriptors(30, 7)
    almost = np.rint(first + np.random.default_rng(8).normal(0, 3.0, first.shape)).clip(0, 255).astype(np.float32)
    nearer = np.rint(first + np.random.default_rng(9).normal(0, 2.9, first.shape)).clip(0, 255).astype(np.float32)
    second = np.stack([almost, nearer])[order].transpose(1, 0, 2).reshape(-1, 128)
    assert len(nearest_matches(first, nearer)) == 30
    every = np.ones((len(first), len(second)), bool)
    assert_array_equal(nearest_matches(first, second), by_sorting(first, second, every))
    assert_array_equal(nearest_matches(second, first), by_sorting(second, first, every.T))
    assert len(nearest_matches(first, second)) < 25


def test_only_what_is_near_by_sampson_is_compared():
    """Lines of any slope and length, in both photos, so that about half of all are near."""
    first, random = descriptors(300, 10), np.random.default_rng(11)
    second, _ = seen_again(first, 0.9, 12)
    line, back, ray = (random.normal(0, 1, (n, 3)) for n in (len(first), len(second), len(second)))
    slope = (line[:, :2] ** 2).sum(axis=1)[:, None] + (back[:, :2] ** 2).sum(axis=1)
    near = (line @ ray.T) ** 2 <= 0.4 * slope
    assert 0.3 < near.mean() < 0.7
    lines = Lines(line, back, ray, np.sqrt(0.4))
    found = nearest_matches(first, second, lines)
    assert_array_equal(found, by_sorting(first, second, near))
    assert lines.hold(found).all()
    every = nearest_matches(first, second)
    assert_array_equal(lines.hold(every), near[every[:, 0], every[:, 1]])
    assert 0.2 < lines.hold(every).mean() < 0.8


def test_nothing_matches_nothing():
    some = descriptors(5, 4)
    assert nearest_matches(some[:0], some).shape == nearest_matches(some, some[:0]).shape == (0, 2)


def test_a_line_tells_which_of_two_alike_is_meant():
    """A repeating print: each descriptor is there twice, at another height; the lines are level."""
    first, random = descriptors(BLOCK + 50, 5), np.random.default_rng(6)
    height = random.uniform(-0.4, 0.4, len(first))
    second = np.vstack([first, first])
    there = np.concatenate([height, height + 0.05]) + random.uniform(-0.001, 0.001, 2 * len(first))
    ray = np.column_stack([random.uniform(-0.5, 0.5, len(there)), there, np.ones(len(there))])
    line = np.column_stack([np.zeros(len(first)), np.ones(len(first)), -height])
    back = np.column_stack([np.zeros(len(there)), np.ones(len(there)), -there])
    assert len(nearest_matches(first, second)) == 0
    most = 0.002 / np.sqrt(2.0)  # either of the two may give way
    found = nearest_matches(first, second, Lines(line, back, ray, most))
    assert_array_equal(found, by_sorting(first, second, np.abs(height[:, None] - there) < 0.002))
    assert len(found) > 0.95 * len(first)
    assert_array_equal(found[:, 0], found[:, 1])


def test_a_match_is_confirmed_by_a_third_photo_that_matches_both():
    matches = {
        ("a", "b"): np.array([[0, 5], [1, 6], [2, 7], [3, 8]], np.uint32),
        ("a", "c"): np.array([[0, 2], [1, 3], [4, 4]], np.uint32),
        ("b", "c"): np.array([[5, 2], [6, 0], [8, 4]], np.uint32),  # 1 of a and 6 of b match others of c
        ("b", "d"): np.array([[7, 1]], np.uint32),  # and d matches nothing of a
    }
    found = confirmed(matches, {"a": 5, "b": 9, "c": 5, "d": 2})
    assert_array_equal(found["a", "b"], [True, False, False, False])
    assert_array_equal(found["a", "c"], [True, False, False])
    assert_array_equal(found["b", "c"], [True, False, False])
    assert_array_equal(found["b", "d"], [False])
