"""A panel flipped, and one that is drawn as a half, with the line along which the cloth is folded: opened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.io.patterns.loops import Chain, edges_points, reversed_edge
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Panel

_ON_LINE_M = 5e-4  # drawn by hand or rounded to a hundredth of an inch


class Fold:
    """The line of a fold.

    Args:
        ends: Two places on it [m], shape (2, 2).
    """

    def __init__(self, ends: FloatArray) -> None:
        self.start = ends[0]
        way = ends[1] - ends[0]
        self.along = way / np.linalg.norm(way)

    def offset(self, points: FloatArray) -> FloatArray:
        """Return signed distances of points (N, 2) from the line [m], shape (N,)."""
        way = points - self.start
        return np.asarray(self.along[0] * way[:, 1] - self.along[1] * way[:, 0])

    def mirrored(self, points: FloatArray) -> FloatArray:
        """Return points (N, 2) on the other side of the line."""
        across = np.array([-self.along[1], self.along[0]])
        return np.asarray(points - 2.0 * self.offset(points)[:, None] * across)

    def mirrored_edge(self, edge: Edge) -> Edge:
        """Return an edge on the other side, run through in the same direction."""
        return replace(edge, points=self.mirrored(edge.points), bulge=-edge.bulge)

    def cuts_off(self, loop: Sequence[Edge]) -> bool:
        """Return whether an outline lies on one side of the line, with an edge along it."""
        offset = self.offset(edges_points(loop, _ON_LINE_M))
        one_side = min(float(offset.max()), -float(offset.min())) <= _ON_LINE_M
        return one_side and any(self._lies_on(edge) for edge in loop)

    def half(self, loop: Sequence[Edge]) -> list[int]:
        """Return the numbers of the edges of an outline that do not lie along the fold, in order from its end."""
        on = [self._lies_on(edge) for edge in loop]
        first = next(k for k in range(len(loop)) if on[k - 1] and not on[k])
        order = [(first + k) % len(loop) for k in range(len(loop))]
        return [k for k in order if not on[k]]

    def opened(self, loop: Sequence[Edge]) -> tuple[Edge, ...]:
        """Return an outline and its mirror picture as one, without the edges along the fold."""
        half = [loop[k] for k in self.half(loop)]
        other = [reversed_edge(self.mirrored_edge(edge)) for edge in reversed(half)]
        whole = [*half, *other]
        joint = len(half)  # the halves meet on the line, to within what was taken for on it
        for k in (joint, 0):
            points = whole[k].points.copy()
            points[0] = whole[k - 1].points[-1]
            whole[k] = replace(whole[k], points=points)
        return tuple(whole)

    def opened_panel(self, panel: Panel) -> Panel:
        """Return a panel that the line cuts off, with its other half."""
        return replace(
            panel,
            edges=self.opened(panel.edges),
            lines=self.lines(panel.lines),
            notches=self.notches(panel.notches),
            drills=None if panel.drills is None else self.drills(panel.drills),
            cut=self.opened(panel.cut) if panel.cut and self.cuts_off(panel.cut) else (),
        )

    def mirrored_panel(self, panel: Panel) -> Panel:
        """Return a panel on the other side of the line, anticlockwise: its edges come in reverse."""

        def turned(loop: Sequence[Edge]) -> tuple[Edge, ...]:
            return tuple(reversed_edge(self.mirrored_edge(edge)) for edge in reversed(loop))

        return replace(
            panel,
            edges=turned(panel.edges),
            grain=None if panel.grain is None else self.mirrored(panel.grain),
            lines=tuple(InnerLine(one.kind, tuple(map(self.mirrored_edge, one.curves))) for one in panel.lines),
            notches=tuple(map(self._mirrored_notch, panel.notches)),
            drills=None if panel.drills is None else self.mirrored(panel.drills),
            cut=turned(panel.cut),
            placement=None,
        )

    def notches(self, notches: Sequence[Notch]) -> tuple[Notch, ...]:
        """Return notches and their mirror pictures."""
        off = [one for one in notches if abs(self.offset(one.position[None])[0]) > _ON_LINE_M]
        return (*notches, *map(self._mirrored_notch, off))

    def _mirrored_notch(self, notch: Notch) -> Notch:
        turn = 2.0 * float(np.arctan2(self.along[1], self.along[0]))
        angle = None if notch.angle is None else turn - notch.angle
        return replace(notch, position=self.mirrored(notch.position[None])[0], angle=angle)

    def lines(self, lines: Sequence[InnerLine]) -> tuple[InnerLine, ...]:
        """Return lines and their mirror pictures."""
        return tuple(lines) + tuple(
            InnerLine(one.kind, tuple(self.mirrored_edge(edge) for edge in one.curves))
            for one in lines
            if not all(self._lies_on(edge) for edge in one.curves)
        )

    def drills(self, drills: FloatArray) -> FloatArray:
        """Return drill holes (D, 2) and their mirror pictures."""
        return np.concatenate([drills, self.mirrored(drills[np.abs(self.offset(drills)) > _ON_LINE_M])])

    def _lies_on(self, edge: Edge) -> bool:
        return bool(np.abs(self.offset(edge.points)).max() <= _ON_LINE_M) and edge.kind != "arc"


def fold_of(chains: Sequence[Chain]) -> FloatArray | None:
    """Return the ends of the first line among chains [m], shape (2, 2), or None."""
    return np.stack([chains[0].start, chains[0].end]) if chains and not chains[0].is_closed else None
