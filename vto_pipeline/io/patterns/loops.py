"""Pieces of outlines, in any order and direction, joined end to end into closed loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge
from vto_pipeline.numerics.plane_curves import curve_area, curve_at, curve_length, flatten

JOIN_M = 1e-4
"""Ends as near as this are taken for one place: files keep four digits of a millimetre at worst three of an inch."""


@dataclass(frozen=True)
class Chain:
    """Edges end to end.

    Args:
        name: Where they come from in the file, for messages.
        edges: In order.
    """

    name: str
    edges: tuple[Edge, ...]

    @property
    def start(self) -> FloatArray:
        """The first point [m], shape (2,)."""
        return self.edges[0].points[0]

    @property
    def end(self) -> FloatArray:
        """The last point [m], shape (2,)."""
        return self.edges[-1].points[-1]

    @property
    def is_closed(self) -> bool:
        """Whether it ends where it starts."""
        return bool(np.linalg.norm(self.start - self.end) <= JOIN_M)


@dataclass(frozen=True)
class Joined:
    """What became of chains.

    Args:
        loops: Closed; each named after its first chain.
        open: Those whose ends meet no other, as far as they could be joined.
        branching: Those at places where more than two ends meet.
        doubled: Names of chains that were there twice, and are left out once.
    """

    loops: tuple[Chain, ...]
    open: tuple[Chain, ...]
    branching: tuple[Chain, ...]
    doubled: tuple[str, ...]


def join(chains: Sequence[Chain]) -> Joined:
    """Join chains whose ends lie within `JOIN_M` of each other."""
    repeated = _repeated(chains)
    kept = [chain for k, chain in enumerate(chains) if k not in repeated]
    doubled = [chains[k].name for k in sorted(repeated)]
    loops = [_closed(chain) for chain in kept if chain.is_closed]
    loose = [chain for chain in kept if not chain.is_closed]
    groups, branching = _groups(loose)
    opened: list[Chain] = []
    for group in groups:
        line = _line_up(group)
        (loops if line.is_closed else opened).append(_closed(line) if line.is_closed else line)
    return Joined(tuple(loops), tuple(opened), tuple(branching), tuple(doubled))


def reversed_edge(edge: Edge) -> Edge:
    """Return an edge run through from its end to its start."""
    return Edge(edge.kind, edge.points[::-1], -edge.bulge, edge.label)


def edges_area(edges: Sequence[Edge]) -> float:
    """Return what a closed outline encloses [m²], positive where it runs anticlockwise."""
    return sum(curve_area(one.kind, one.points, one.bulge) for one in edges)


def edges_length(edges: Sequence[Edge]) -> float:
    """Return the length of edges [m]."""
    return sum(curve_length(one.kind, one.points, one.bulge) for one in edges)


def edges_points(edges: Sequence[Edge], tolerance: float) -> FloatArray:
    """Return edges as one polyline within the tolerance [m], shape (N, 2)."""
    parts = [flatten(one.kind, one.points, one.bulge, tolerance)[:-1] for one in edges]
    return np.concatenate([*parts, edges[-1].points[-1:]])


def anticlockwise(edges: Sequence[Edge]) -> tuple[Edge, ...]:
    """Return a closed outline run through anticlockwise."""
    return tuple(edges) if edges_area(edges) >= 0.0 else tuple(reversed_edge(one) for one in reversed(edges))


def moved_ends(edge: Edge, start: FloatArray, end: FloatArray) -> Edge:
    """Return an edge between other ends, which are near its own."""
    points = edge.points.copy()
    points[0], points[-1] = start, end
    return Edge(edge.kind, points, edge.bulge, edge.label)


def _repeated(chains: Sequence[Chain]) -> set[int]:
    """Return the numbers of chains that run along the same line as one before them, in either direction."""
    if not chains:
        return set()
    five = np.array([_five(chain) for chain in chains])
    back = np.where([[[chain.is_closed]] for chain in chains], five, five[:, ::-1])
    both = cKDTree(np.concatenate([five, back]).reshape(-1, 10))
    near = both.query_ball_point(five.reshape(-1, 10), JOIN_M, p=np.inf)
    return {k for k, found in enumerate(near) if min(one % len(chains) for one in found) < k}


def _five(chain: Chain) -> FloatArray:
    """Return start, middle and end of a chain, and the middles of its first and its last edge, shape (5, 2)."""
    half = np.array([0.5])
    ends = [curve_at(e.kind, e.points, e.bulge, half) for e in (chain.edges[0], chain.edges[-1])]
    middle = np.mean([e.points.mean(axis=0) for e in chain.edges], axis=0)
    return np.concatenate([chain.start[None], ends[0], middle[None], ends[1], chain.end[None]])


def _groups(chains: Sequence[Chain]) -> tuple[list[list[Chain]], list[Chain]]:
    """Return chains that are connected, and apart from them all of any group in which more than two ends meet."""
    if not chains:
        return [], []
    ends = np.concatenate([[chain.start, chain.end] for chain in chains])
    pairs = cKDTree(ends).query_pairs(JOIN_M, output_type="ndarray")
    meeting = np.bincount(pairs.ravel(), minlength=len(ends))
    links = pairs // 2
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(len(chains), len(chains)))
    count, group = connected_components(graph, directed=False)
    groups: list[list[Chain]] = []
    branching: list[Chain] = []
    for number in range(count):
        members = np.flatnonzero(group == number).tolist()
        found = [chains[k] for k in members]
        if (meeting.reshape(-1, 2)[members] > 1).any():
            branching += found
        else:
            groups.append(found)
    return groups, branching


def _line_up(group: list[Chain]) -> Chain:
    """Return connected chains as one, with no place where more than two ends meet."""
    rest = list(group)
    line = rest.pop(0)
    forward = True
    while rest:
        near = [(k, chain) for k, chain in enumerate(rest) if _meets(line.end, chain)]
        if near:
            k, chain = near[0]
            line = _append(line, chain)
            rest.pop(k)
        elif forward:
            line, forward = _turned(line), False
        else:
            break
    return line if forward else _turned(line)


def _meets(place: FloatArray, chain: Chain) -> bool:
    return bool(min(np.linalg.norm(place - chain.start), np.linalg.norm(place - chain.end)) <= JOIN_M)


def _append(line: Chain, chain: Chain) -> Chain:
    if np.linalg.norm(line.end - chain.start) > JOIN_M:
        chain = _turned(chain)
    first = chain.edges[0]
    joined = moved_ends(first, line.end, first.points[-1])
    return Chain(line.name, (*line.edges, joined, *chain.edges[1:]))


def _turned(chain: Chain) -> Chain:
    return Chain(chain.name, tuple(reversed_edge(one) for one in reversed(chain.edges)))


def _closed(chain: Chain) -> Chain:
    """Return a chain whose end is exactly its start."""
    last = chain.edges[-1]
    if len(chain.edges) == 1 and last.kind == "arc":
        return chain
    start = chain.start if len(chain.edges) > 1 else last.points[0]
    return Chain(chain.name, (*chain.edges[:-1], moved_ends(last, last.points[0], start)))
