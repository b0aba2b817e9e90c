"""Samples along the edges of panels, as many on both sides of each seam, so that they are welded one to one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import GarmentError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Panel, Pattern, Side
from vto_pipeline.numerics.plane_curves import curve_length

EdgeKey = tuple[str, int]
"""Panel and number of an edge."""

_SAME_BREAK = 0.3  # of the target edge: ends of edges on both sides of a seam as near as this are sewn to each other
_SAME = 1e-9  # of a seam: nearer samples are one


@dataclass(frozen=True)
class Samples:
    """Where the edges of a pattern are sampled.

    Args:
        shares: Of each edge: shares of its length, from 0 to 1.
        links: Pairs of samples that are one point when sewn; each an edge and the number of the sample.
    """

    shares: Mapping[EdgeKey, FloatArray]
    links: Sequence[tuple[tuple[EdgeKey, int], tuple[EdgeKey, int]]]


def sample_edges(pattern: Pattern, edge: float) -> Samples:
    """Return samples about one edge length apart.

    Args:
        pattern: Of one size.
        edge: Target edge length of the mesh [m].

    Raises:
        GarmentError: an edge is in two seams.
    """
    panels = {panel.name: panel for panel in pattern.panels}
    lengths = {
        (panel.name, k): curve_length(e.kind, e.points, e.bulge)
        for panel in pattern.panels
        for k, e in enumerate(panel.edges)
    }
    _check_once(pattern)
    shares: dict[EdgeKey, FloatArray] = {}
    links = []
    for stitch in pattern.stitches:
        first, second = (_Chain(chain, lengths) for chain in (stitch.first, stitch.second))
        at = _matched(first, second, edge)
        samples = [chain.sampled(at[:, k]) for k, chain in enumerate((first, second))]
        for chain_shares, _ in samples:
            shares |= chain_shares
        links += list(zip(samples[0][1], samples[1][1], strict=True))
    for key, length in lengths.items():
        shares.setdefault(key, np.linspace(0.0, 1.0, max(_least(panels[key[0]]), round(length / edge)) + 1))
    return Samples(shares, links)


def _least(panel: Panel) -> int:
    """Return into how many pieces an edge is divided at least: an outline needs three samples."""
    return max(1, -(-3 // len(panel.edges)))


def _check_once(pattern: Pattern) -> None:
    seen: dict[EdgeKey, int] = {}
    for number, stitch in enumerate(pattern.stitches):
        for side in (*stitch.first, *stitch.second):
            key = (side.panel, side.edge)
            if key in seen:
                problem = f"edge {side.edge} of panel {side.panel!r} is in stitch {seen[key]} and in stitch {number}"
                raise GarmentError(problem, hint="three layers in one seam cannot be sewn yet")
            seen[key] = number


class _Chain:
    """One side of a seam.

    Args:
        sides: Its edges.
        lengths: Of all edges [m].
    """

    def __init__(self, sides: Sequence[Side], lengths: Mapping[EdgeKey, float]) -> None:
        self.sides = sides
        ends = np.cumsum([0.0, *(lengths[side.panel, side.edge] for side in sides)])
        self.length = float(ends[-1])
        self.breaks = ends / self.length

    def sampled(self, at: FloatArray) -> tuple[dict[EdgeKey, FloatArray], list[tuple[EdgeKey, int]]]:
        """Return the shares of each edge, and for each place on the chain (0 to 1, ascending) its edge and sample."""
        shares: dict[EdgeKey, FloatArray] = {}
        places: list[tuple[EdgeKey, int]] = []
        for k, side in enumerate(self.sides):
            low, high = self.breaks[k], self.breaks[k + 1]
            inside = at[(at >= low - _SAME) & (at <= high + _SAME)]
            local = np.clip((inside - low) / (high - low), 0.0, 1.0)
            local[0], local[-1] = 0.0, 1.0
            key = (side.panel, side.edge)
            shares[key] = local if side.forward else 1.0 - local[::-1]
            numbers = range(len(local)) if side.forward else range(len(local) - 1, -1, -1)
            places += [(key, number) for number in numbers][bool(places) :]
        return shares, places


def _matched(first: _Chain, second: _Chain, edge: float) -> FloatArray:
    """Return places on both chains that are sewn to each other, the ends of all edges among them, shape (N, 2)."""
    near = _SAME_BREAK * edge / max(first.length, second.length)
    pairs = [(0.0, 0.0)]
    others = list(second.breaks[1:-1])
    for place in first.breaks[1:-1]:
        closest = min(others, key=lambda other: abs(other - place), default=np.inf)
        if abs(closest - place) <= near:
            others.remove(closest)
        pairs.append((place, closest if abs(closest - place) <= near else place))
    pairs += [(other, other) for other in others]
    borders = np.array([*sorted(pairs), (1.0, 1.0)])
    longest = np.maximum(first.length * np.diff(borders[:, 0]), second.length * np.diff(borders[:, 1]))
    counts = np.maximum(1, np.rint(longest / edge).astype(int))
    if counts.sum() < 2:
        counts[0] = 2  # so that no panel is left with two samples
    parts = [
        np.linspace(a, b, count, endpoint=False) for a, b, count in zip(borders[:-1], borders[1:], counts, strict=True)
    ]
    return np.concatenate([*parts, borders[-1:]])
