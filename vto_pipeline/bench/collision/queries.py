"""Continuous tests: missed, false, how early, and how many per second, compared with Tight-Inclusion.

The peer (Wang et al. 2021, "A large-scale benchmark and an inclusion-based algorithm for continuous collision
detection") is ipctk's, where that is installed. It answers as many of the same queries as fit in its budget, one by one
and in one thread; ours then answer those again, in one thread. What a call costs from Python is measured with a query
that is decided at once, and taken off the peer's time. It is asked at cloth sizes only, as its tolerance is a length,
and with fewer iterations than its default: it then gives up sooner, with the conservative answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.collision.known_queries import CLOTH, HITS, MISSES, REACH, Queries, hits, misses
from vto_pipeline.bench.scaling.throughput import seconds_of
from vto_pipeline.bench.timing import Timing
from vto_pipeline.numerics.ccd import edge_edge_impact, vertex_face_impact
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.distance import barycentric_point, closest_on_segments, closest_on_triangle
from vto_pipeline.numerics.vector import axpy, load_at, norm, scale, sub

_PEER_BUDGET = 5.0  # s for each row; a fiftieth when quick
_PEER_TOLERANCE, _PEER_ITERATIONS = 1e-6, 100_000  # its default; a hundredth of its default
_TOLD = 0.1  # of the time: less than this beside the cost of calling is not measured
_GAPS = (2**40, 2**30, 2**20, 2**10, 1)  # of 2^40
_SEED = 1


class Family(NamedTuple):
    """What one pair of rows is about.

    Args:
        scene: Its name.
        gap: Least distance of its misses, as a share of the size; None for hits.
        cloth: Whether its figures have the size of cloth's.
        make: From the count to the queries.
    """

    scene: str
    gap: float | None
    cloth: bool
    make: Callable[[int], Queries]


def query_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Measure every family of known queries."""
    count = 10_000 if quick else 100_000
    peer = find_spec("ipctk") is not None
    if not peer:
        watch("Tight-Inclusion left out: ipctk is not installed")
    for family in _families():
        settings: dict[str, Value] = {} if family.gap is None else {"gap_share": family.gap}
        yield watch.row(family.scene, "planes", settings, count, partial(_ours, family, count))
        if peer and family.cloth:
            budget = 0.02 * _PEER_BUDGET if quick else _PEER_BUDGET
            yield watch.row(family.scene, "tight_inclusion", settings, count, partial(_peers, family, count, budget))


def impact(queries: Queries) -> NDArray[np.float64]:
    """Return the times of the project's own test."""
    return (edge_edge_impact if queries.edges else vertex_face_impact)(queries.start, queries.end)


def missed(queries: Queries, times: NDArray[np.float64]) -> int:
    """Return how many hits were reported late or not at all."""
    return int(np.sum(~(times <= queries.latest)))


def false_share(times: NDArray[np.float64]) -> float:
    """Return the share of misses reported as hits."""
    return float(np.mean(np.isfinite(times)))


def early(queries: Queries, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far apart the features still are at the times reported, as a share of the query's size."""
    start, end = queries.start - queries.start[:, :1], queries.end - queries.end[:, :1]
    size, exponent = np.frexp(np.maximum(np.abs(start).max(axis=(1, 2)), np.abs(end).max(axis=(1, 2))))
    down = -exponent[:, None, None]
    at = times[:, None, None]
    figure = (1.0 - at) * np.ldexp(start, down) + at * np.ldexp(end, down)
    return apart(figure, queries.edges) / np.where(size > 0.0, size, 1.0)


@njit(cache=True, error_model="numpy")
def apart(points, edges):  # type: ignore[no-untyped-def]
    """Return the distance of each vertex and face or of each two edges; points of shape (N, 4, 3)."""
    distance = np.empty(len(points))
    for i in range(len(points)):
        a, b, c, d = load_at(points, i, 0), load_at(points, i, 1), load_at(points, i, 2), load_at(points, i, 3)
        if edges:
            s, t = closest_on_segments(a, b, c, d)
            between = sub(axpy(t, sub(d, c), sub(c, a)), scale(s, sub(b, a)))
        else:
            between = sub(a, barycentric_point(closest_on_triangle(a, b, c, d)[0], b, c, d))
        distance[i] = norm(between)
    return distance


def _families() -> Iterator[Family]:
    for edges in (False, True):
        kind = "edge-edge" if edges else "vertex-face"
        for name, family in HITS.items():
            cloth = family.exponents == (CLOTH,)
            yield Family(f"{kind}, {name}", None, cloth, partial(hits, name, edges=edges, seed=_SEED))
        for name in MISSES:
            for gap in _GAPS:
                make = partial(misses, name, gap, edges=edges, seed=_SEED)
                yield Family(f"{kind}, {name}", gap / REACH, True, make)


def _ours(family: Family, count: int) -> Measured:
    queries = family.make(count)
    timing = seconds_of(partial(impact, queries))
    times = impact(queries)
    errors: dict[str, Value] = {"per_second": count / timing.seconds}
    if family.gap is None:
        how_early = early(queries, times)
        errors["missed"] = missed(queries, times)
        errors["early_share_median"] = float(np.median(how_early))
        errors["early_share_99"] = float(np.quantile(how_early, 0.99))
        errors["early_share_max"] = float(how_early.max())
    else:
        errors["false_share"] = false_share(times)
    return timing, errors


def _peers(family: Family, count: int, budget: float) -> Measured:
    from ipctk import tight_inclusion

    queries = family.make(count)
    ask = tight_inclusion.edge_edge_ccd if queries.edges else tight_inclusion.point_triangle_ccd
    far = np.zeros((4, 3))
    far[: 2 if queries.edges else 1] = 1.0  # one feature at one place and the other at another, at rest
    call = seconds_of(partial(ask, *far, *far)).seconds
    times: list[float] = []
    began = time.perf_counter()
    while len(times) < count and time.perf_counter() - began < budget:
        points = *queries.start[len(times)], *queries.end[len(times)]
        hit, when, _ = ask(*points, tolerance=_PEER_TOLERANCE, max_iterations=_PEER_ITERATIONS)
        times.append(when if hit else np.inf)
    seconds = time.perf_counter() - began
    asked = len(times)
    few = Queries(queries.start[:asked], queries.end[:asked], queries.edges, queries.latest[:asked], queries.gap)
    with limited_threads(1):
        ours = seconds_of(partial(impact, few)).seconds
    net = seconds - asked * call
    errors: dict[str, Value] = {
        "asked": asked,
        "call_us": 1e6 * call,
        "per_second": asked / seconds,
        "per_second_without_call": asked / net if net > _TOLD * seconds else "not told from the call",
        "ours_per_second": asked / ours,
        "ours_times_as_fast": net / ours if net > _TOLD * seconds else "not told from the call",
    }
    answers = np.array(times)
    if family.gap is None:
        errors["missed"] = missed(few, answers)
    else:
        errors["false_share"] = false_share(answers)
    return Timing(seconds), errors
