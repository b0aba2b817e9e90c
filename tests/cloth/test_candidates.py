"""Candidates against brute force over all features, and against ipctk's broad phase."""

import ipctk
import numpy as np
import pytest
from cloth_scenes import sheet
from moving_sheets import boxes_of, brute_pairs, crumple, fold, judge
from numpy.testing import assert_array_equal

from vto_pipeline.cloth.collision.self_collision.candidates import cross_candidates, self_candidates
from vto_pipeline.cloth.collision.self_collision.surface_features import features
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.spatial import bvh


def tree_of(start, end, faces, radius):
    tree = bvh.build(start, faces)
    bvh.refit_swept(tree, start, end, faces, radius)
    return tree


def by_brute_force(kinds, start, end, radius, skip):
    """Pairs (vertex, face) and (edge, edge) without a common vertex."""
    corner = np.arange(len(start), dtype=np.int32)[:, None]

    def pairs(one, other):
        found = brute_pairs(*boxes_of(one, start, end, radius), *boxes_of(other, start, end, radius))
        ends, others = one[found[:, 0]], other[found[:, 1]]
        shared = (ends[:, :, None] == others[:, None, :]).any(axis=(1, 2))
        return found[~shared & ~skip[ends].any(axis=1) & ~skip[others].any(axis=1)]

    edges = pairs(kinds.edges, kinds.edges)
    return pairs(corner, kinds.faces), edges[edges[:, 0] < edges[:, 1]]


def scene(name):
    mesh = sheet(12, 12, 1.0, 1.0, upright=False)
    rng = np.random.default_rng(7)
    x, faces = mesh.vertices, mesh.faces
    if name == "folded":
        start = fold(x, 4, 0.02)
        return start, start + np.array([0.0, -0.05, 0.02]), faces, np.full(len(x), 0.004)
    if name == "crumpled":
        return crumple(x, 0.15, 1), crumple(x, 0.15, 2), faces, rng.uniform(0, 0.02, len(x))
    if name == "flat, touching":  # boxes of which many touch in a corner exactly
        return x.copy(), x.copy(), faces, np.zeros(len(x))
    if name == "all in one point":
        return np.ones_like(x), np.ones_like(x), faces, np.zeros(len(x))
    if name == "huge":
        return 1e150 * crumple(x, 0.1, 3), 1e150 * crumple(x, 0.1, 4), faces, np.full(len(x), 1e148)
    if name == "denormal":
        return 1e-310 * crumple(x, 0.1, 3), 1e-310 * crumple(x, 0.1, 4), faces, np.full(len(x), 1e-312)
    if name == "one vertex flies far":
        end = x.copy()
        end[70] = [1e6, -1e6, 3.0]
        return x.copy(), end, faces, np.zeros(len(x))
    triangles = rng.normal(0, 1, (60, 1, 3)) + rng.normal(0, 0.2, (60, 3, 3))  # not connected, and some without area
    triangles[:5, 1] = triangles[:5, 0]
    start = triangles.reshape(-1, 3)
    soup = np.arange(180, dtype=np.int32).reshape(-1, 3)
    return start, start + rng.normal(0, 0.2, start.shape), soup, rng.uniform(0, 0.05, 180)


SCENES = [
    "folded",
    "crumpled",
    "flat, touching",
    "all in one point",
    "huge",
    "denormal",
    "one vertex flies far",
    "soup",
]


@pytest.mark.parametrize("name", SCENES)
def test_all_pairs_and_no_others(name):
    start, end, faces, radius = scene(name)
    kinds = features(faces, len(start))
    to_face, to_edge = self_candidates(tree_of(start, end, faces, radius), kinds, start, end, radius)
    wanted_face, wanted_edge = by_brute_force(kinds, start, end, radius, np.zeros(len(start), np.bool_))
    assert_array_equal(to_face, wanted_face)
    assert_array_equal(to_edge, wanted_edge)
    assert name == "flat, touching" or len(to_edge) > 50


def test_what_is_skipped_takes_no_part():
    start, end, faces, radius = scene("crumpled")
    kinds = features(faces, len(start))
    skip = np.random.default_rng(0).random(len(start)) < 0.2
    found = self_candidates(tree_of(start, end, faces, radius), kinds, start, end, radius, skip)
    wanted = by_brute_force(kinds, start, end, radius, skip)
    assert_array_equal(found[0], wanted[0])
    assert_array_equal(found[1], wanted[1])
    assert 50 < len(found[0]) < len(by_brute_force(kinds, start, end, radius, ~skip & skip)[0])


def test_two_surfaces():
    start, end, faces, radius = scene("crumpled")
    kinds, skip = features(faces, len(start)), np.random.default_rng(0).random(len(start)) < 0.1
    body = sheet(9, 7, 0.8, 1.2)
    there = np.array([0.1, 0.6, 0.5])
    before, after = crumple(body.vertices, 0.2, 5) + there, crumple(body.vertices, 0.2, 6) + there
    none = np.zeros(len(before))
    other = features(body.faces, len(before))
    found = cross_candidates(
        tree_of(start, end, faces, radius),
        kinds,
        start,
        end,
        radius,
        tree_of(before, after, body.faces, none),
        other,
        before,
        after,
        skip,
    )
    cloth, still = (start, end, radius), (before, after, none)
    corner, body_corner = (np.arange(len(x), dtype=np.int32)[:, None] for x in (start, before))
    for pairs, one, two, at, cloth_is_first in (
        (found[0], corner, other.faces, 0, True),
        (found[1], body_corner, kinds.faces, 1, False),
        (found[2], kinds.edges, other.edges, 0, True),
    ):
        first, second = (cloth, still) if cloth_is_first else (still, cloth)
        wanted = brute_pairs(*boxes_of(one, *first), *boxes_of(two, *second))
        taking_part = ~skip[(one if cloth_is_first else two)[wanted[:, at]]].any(axis=1)
        assert_array_equal(pairs, wanted[taking_part])
        assert 20 < taking_part.sum() < len(wanted)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_missed_that_ipctk_finds(seed):
    mesh = sheet(20, 20, 1.0, 1.0, upright=False)
    start, end = crumple(mesh.vertices, 0.2, seed), crumple(mesh.vertices, 0.2, seed + 10)
    radius = np.full(len(start), 0.003)
    kinds = features(mesh.faces, len(start))
    to_face, to_edge = self_candidates(tree_of(start, end, mesh.faces, radius), kinds, start, end, radius)
    theirs = ipctk.Candidates()
    surface = judge(mesh.faces, start)
    theirs.build(surface, np.asfortranarray(start), np.asfortranarray(end), inflation_radius=0.003)
    key = {tuple(edge): k for k, edge in enumerate(kinds.edges.tolist())}
    edge = [key[tuple(sorted(pair))] for pair in np.asarray(surface.edges).tolist()]
    wanted_face = {(c.vertex_id, c.face_id) for c in theirs.fv_candidates}
    wanted_edge = {tuple(sorted((edge[c.edge0_id], edge[c.edge1_id]))) for c in theirs.ee_candidates}
    assert wanted_face <= set(map(tuple, to_face.tolist()))
    assert wanted_edge <= set(map(tuple, to_edge.tolist()))
    assert len(wanted_face) > 300
    assert len(to_face) < 1.02 * len(wanted_face)  # they, too, take boxes: no more than rounding between them


def test_the_same_for_any_number_of_threads():
    mesh = sheet(48, 48, 1.0, 1.0, upright=False)
    start = fold(mesh.vertices, 6, 0.01)
    end, radius = start + np.array([0.0, -0.01, 0.0]), np.full(len(start), 0.003)
    kinds = features(mesh.faces, len(start))
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            found.append(self_candidates(tree_of(start, end, mesh.faces, radius), kinds, start, end, radius))
    assert_array_equal(found[0][0], found[1][0])
    assert_array_equal(found[0][1], found[1][1])
    assert len(found[0][0]) > 10_000


def test_every_feature_has_one_owner():
    mesh = sheet(7, 5, 1.0, 1.0)
    faces = np.vstack([mesh.faces, mesh.faces[:1], [[0, 1, 36]]]).astype(np.int32)  # a face twice, a fin; 35 is alone
    kinds = features(faces, 37)
    assert_array_equal(np.sort(kinds.own_vertices[kinds.own_vertices >= 0]), np.r_[0:35, 36])
    assert_array_equal(np.sort(kinds.own_edges[kinds.own_edges >= 0]), np.arange(len(kinds.edges)))
    for face, own, edges in zip(kinds.faces, kinds.own_vertices, kinds.own_edges, strict=True):
        assert set(own[own >= 0]) <= set(face)
        assert set(kinds.edges[edges[edges >= 0]].ravel()) <= set(face)
    every = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert_array_equal(kinds.edges, np.unique(every, axis=0))
