"""Continuous collision detection against queries built around their answer, exact roots, and Tight-Inclusion."""

from fractions import Fraction

import numpy as np
import pytest
from exact_distance import exact_distance_sq
from exact_impact import Coplanar, first_contact, not_after
from ipctk import tight_inclusion
from numba import njit
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.bench.collision.known_queries import CLOTH, HITS, MISSES, REACH, hits, misses
from vto_pipeline.bench.collision.queries import apart, early, false_share, impact, missed
from vto_pipeline.errors import InputError
from vto_pipeline.numerics.ccd import edge_edge_impact, edge_edge_time, vertex_face_impact, vertex_face_time
from vto_pipeline.numerics.vector import load_at

KINDS = pytest.mark.parametrize("edges", [False, True], ids=["vertex-face", "edge-edge"])
IMPACT = {False: vertex_face_impact, True: edge_edge_impact}


def exact_positions(queries, i, t):
    """Positions of query i at time t in fractions."""
    both = zip(queries.start[i].ravel().tolist(), queries.end[i].ravel().tolist(), strict=True)
    flat = [Fraction(a) + Fraction(t) * (Fraction(b) - Fraction(a)) for a, b in both]
    return [flat[k : k + 3] for k in range(0, 12, 3)]


@KINDS
def test_known_queries_are_as_they_say(edges):
    for name in HITS:
        queries = hits(name, 8, edges, seed=13)
        for i in range(8):
            assert exact_distance_sq(exact_positions(queries, i, queries.latest[i]), edges) == 0
    for name in MISSES:
        queries = misses(name, 5, 16, edges, seed=14)
        whole = Fraction(2) ** (CLOTH - 20)  # a whole number, in metres
        for i in range(16):
            near_sq = [exact_distance_sq(exact_positions(queries, i, Fraction(k, 8)), edges) for k in range(9)]
            share_sq = min(near_sq) / (5 * whole) ** 2
            assert 1 <= share_sq <= (5 * 7) ** 2  # the scales of turns and frames


def check_hits(name, edges, count, seed):
    queries = hits(name, count, edges, seed)
    times = impact(queries)
    assert missed(queries, times) == 0
    assert times.min() >= 0.0
    still_apart = early(queries, times)
    # how early it may be, as a share of the size: nine of ten, and the worst where rounds run out
    assert np.quantile(still_apart, 0.9) < 1e-8
    assert still_apart.max() < 0.02
    return still_apart


@KINDS
@pytest.mark.parametrize("name", HITS)
def test_no_hit_is_missed_and_none_is_much_too_early(name, edges):
    check_hits(name, edges, 3000, seed=1)


@pytest.mark.slow
@KINDS
@pytest.mark.parametrize("name", HITS)
def test_no_hit_is_missed_in_two_millions(name, edges):
    check_hits(name, edges, 65_000, seed=2)  # 32 families


@KINDS
def test_plain_hits_are_sharp(edges):
    still_apart = check_hits("plain", edges, 3000, seed=3)
    assert np.median(still_apart) < 1e-12
    assert still_apart.max() < 1e-7


@KINDS
@pytest.mark.parametrize("name", MISSES)
def test_misses_are_told_from_hits(name, edges):
    for gap in (REACH, 2**30, 2**20, 2**10):  # to 1e-9 of the size
        assert false_share(impact(misses(name, gap, 1000, edges, seed=4))) == 0.0
    assert false_share(impact(misses(name, 1, 3000, edges, seed=5))) < 0.01  # 1e-12: the margins begin


@KINDS
def test_exact_roots_agree(edges):
    """Small whole numbers, so that corners, edges and planes are met exactly, and often."""
    rng = np.random.default_rng(6)
    start, end = rng.integers(-2, 3, (2, 350, 4, 3)).astype(float)
    found = IMPACT[edges](start, end)
    judged = {True: 0, False: 0}
    for one, other, t in zip(start, end, found, strict=True):
        try:
            contact = first_contact(one, other, edges)
        except Coplanar:
            continue
        judged[contact is not None] += 1
        if contact is None:
            assert t == np.inf
        else:
            assert not_after(t, *contact)
            assert not not_after(t + 1e-6, *contact)  # rounding alone, as these are not near-parallel
    assert min(judged.values()) > 40


@KINDS
def test_tight_inclusion_agrees(edges):
    rng = np.random.default_rng(7)
    start = 0.01 * rng.normal(size=(300, 4, 3))
    end = start + 0.02 * rng.normal(size=start.shape)
    ask = tight_inclusion.edge_edge_ccd if edges else tight_inclusion.point_triangle_ccd
    answers = [ask(*one, *other, max_iterations=20_000) for one, other in zip(start, end, strict=True)]
    theirs = np.array([when if hit else np.inf for hit, when, _ in answers])
    ours = IMPACT[edges](start, end)
    both = np.isfinite(ours)
    assert both.sum() > 10
    assert np.isfinite(theirs[both]).all()  # they err on the side of a hit
    assert_allclose(theirs[both], ours[both], rtol=0, atol=0.02)  # they give up after so many iterations, early
    assert np.isfinite(theirs[~both]).mean() < 0.02


@njit
def kept_times(start, end, edges, keep):
    out = np.empty(len(start))
    for i in range(len(start)):
        a0, b0, c0, d0 = load_at(start, i, 0), load_at(start, i, 1), load_at(start, i, 2), load_at(start, i, 3)
        a1, b1, c1, d1 = load_at(end, i, 0), load_at(end, i, 1), load_at(end, i, 2), load_at(end, i, 3)
        if edges:
            out[i] = edge_edge_time(a0, b0, c0, d0, a1, b1, c1, d1, keep)
        else:
            out[i] = vertex_face_time(a0, b0, c0, d0, a1, b1, c1, d1, keep)
    return out


@KINDS
@pytest.mark.parametrize("keep", [0.1, 0.8])
def test_share_of_the_distance_is_kept_and_no_more(edges, keep):
    rng = np.random.default_rng(8)
    start = rng.normal(size=(1000, 4, 3))
    end = start + 0.5 * rng.normal(size=start.shape)
    times = kept_times(start, end, edges, keep)
    low = keep * apart(start, edges)
    until = np.minimum(times, 1.0)[:, None, None]
    for share in np.linspace(0.0, 1.0, 50):
        now = (1.0 - share * until) * start + share * until * end
        assert (apart(now, edges) >= low * (1.0 - 1e-12)).all()  # rounding
    stopped = np.isfinite(times)
    assert 0.02 < stopped.mean() < 0.7
    ratio = apart((1.0 - until) * start + until * end, edges)[stopped] / low[stopped]
    assert np.quantile(ratio, 0.98) < 1.0 + 1e-4  # a few come near it, and turn away
    assert ratio.max() < 1.5


@KINDS
def test_scale_and_place_do_not_matter(edges):
    rng = np.random.default_rng(9)
    start, end = rng.integers(-64, 65, (2, 400, 4, 3)).astype(float)
    plain = IMPACT[edges](start, end)
    assert 0.05 < np.isfinite(plain).mean() < 0.95
    for exponent in (-1074, -300, 300, 900):
        assert_array_equal(IMPACT[edges](np.ldexp(start, exponent), np.ldexp(end, exponent)), plain)
    assert_array_equal(IMPACT[edges](start + 2.0**40, end - 2.0**40), plain)  # coordinates stay whole


@KINDS
def test_what_touches_at_the_start_touches_at_time_zero(edges):
    together = np.zeros((1, 4, 3))
    assert IMPACT[edges](together, together) == 0.0
    queries = hits("still", 100, edges, seed=10)
    apart_again = queries.end + np.random.default_rng(11).normal(size=queries.end.shape)
    assert (IMPACT[edges](queries.start, apart_again) == 0.0).all()


@KINDS
def test_many_queries_are_answered_as_few(edges):
    queries = hits("plain", 2000, edges, seed=12)
    whole = IMPACT[edges](queries.start, queries.end)
    parts = [IMPACT[edges](a, b) for a, b in zip(np.split(queries.start, 20), np.split(queries.end, 20), strict=True)]
    assert_array_equal(whole, np.concatenate(parts))
    assert IMPACT[edges](np.empty((0, 4, 3)), np.empty((0, 4, 3))).shape == (0,)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1e301])
def test_positions_that_are_not_usable_are_refused(wrong):
    start = np.zeros((3, 4, 3))
    end = start.copy()
    end[2, 1, 0] = wrong
    with pytest.raises(InputError, match=r"end\[2, 1, 0\]"):
        vertex_face_impact(start, end)
    with pytest.raises(InputError, match="shapes"):
        edge_edge_impact(start, end[:2])
