"""Where on a sleeve the shoulder ends: the place on its cap that is sewn to the end of the shoulder seam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vto_pipeline.garment.sizes.outline import Outline
from vto_pipeline.io.patterns.loops import edges_length
from vto_pipeline.model.pattern import Pattern, Side
from vto_pipeline.numerics.plane_curves import at_shares


def shoulder_level(sleeve: Outline, named: Mapping[str, Outline], pattern: Pattern) -> float:
    """Return how far up a sleeve its shoulder point lies [m]; the top of the cap, where no seam says it.

    Args:
        sleeve: A panel of a sleeve.
        named: All panels.
        pattern: With the stitches.
    """
    levels = []
    for stitch in pattern.stitches:
        for own, other in ((stitch.first, stitch.second), (stitch.second, stitch.first)):
            if own[0].panel == sleeve.panel.name and named[other[0].panel].part == "torso":
                levels += [_level(sleeve, own, share) for share in _shoulder_shares(other, named)]
    return max(levels) if levels else float(sleeve.points()[:, 1].max())


def _shoulder_shares(chain: Sequence[Side], named: Mapping[str, Outline]) -> list[float]:
    """Return where along an armhole, as a share of its length, shoulder seams end."""
    lengths = [edges_length([named[side.panel].panel.edges[side.edge]]) for side in chain]
    breaks = np.cumsum([0.0, *lengths]) / sum(lengths)
    shares = []
    for side, low, high in zip(chain, breaks[:-1], breaks[1:], strict=True):
        one = named[side.panel]
        start, end = side.edge, (side.edge + 1) % len(one.corners)
        tips = one.corners_between("shoulder", "armhole")
        places = ((start, low), (end, high)) if side.forward else ((end, low), (start, high))
        shares += [float(share) for corner, share in places if corner in tips]
    return shares


def _level(sleeve: Outline, chain: Sequence[Side], share: float) -> float:
    """Return the height in the sleeve of a place along one side of its seam [m]."""
    edges = [sleeve.panel.edges[side.edge] for side in chain]
    ends = np.cumsum([0.0, *(edges_length([edge]) for edge in edges)])
    number = min(int(np.searchsorted(ends, share * ends[-1], side="right")) - 1, len(edges) - 1)
    local = (share * ends[-1] - ends[number]) / (ends[number + 1] - ends[number])
    edge = edges[number]
    at = np.array([local if chain[number].forward else 1.0 - local])
    return float((at_shares(edge.kind, edge.points, edge.bulge, at) @ sleeve.frame[1])[0])
