"""How far apart the two sides of each seam lie in a drape, from the pattern's file and the drape's triangles alone.

Nothing of the sewing is used: places along the curves of both panels are looked up on the outlines of the triangles
that the panels are laid in, and followed to where these are in space.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.pattern import Panel, Pattern, Side
from vto_pipeline.numerics.plane_curves import at_shares, curve_length

_ASKED = 41  # places along a seam
_SAME_M = 1e-6


def seam_gaps(pattern: Pattern, laid: FloatArray, faces: IntArray, positions: FloatArray) -> list[float]:
    """Return the largest gap of each seam [m].

    Args:
        pattern: Of one size, without grain lines: y is upright.
        laid: Corners of the triangles where the panels are laid side by side, shape (F, 3, 2) [m].
        faces: Shape (F, 3).
        positions: The drape [m], shape (V, 3).
    """
    corner = _corners(laid)
    pieces = _pieces(laid, corner)
    if len(pieces) != len(pattern.panels):
        return [np.inf] * len(pattern.stitches)
    placed = {}
    for panel, piece in zip(pattern.panels, pieces, strict=True):
        outline = np.concatenate([at_shares(e.kind, e.points, e.bulge, np.linspace(0, 1, 99)) for e in panel.edges])
        here = laid[piece].reshape(-1, 2).min(axis=0)
        shift = np.array([here[0] - outline[:, 0].min(), here[1] - outline[:, 1].min()])
        placed[panel.name] = (panel, _Rim(laid[piece] - shift, corner[piece], positions[faces[piece]]))
    gaps = []
    for stitch in pattern.stitches:
        first, second = (_along(side, placed) for side in (stitch.first, stitch.second))
        gaps.append(float(np.linalg.norm(first - second, axis=1).max()))
    return gaps


class _Rim:
    """The outline of one panel's triangles, in its plane (F, 3, 2) and in space (F, 3, 3)."""

    def __init__(self, flat: FloatArray, corner: IntArray, space: FloatArray) -> None:
        start, end = corner, np.roll(corner, -1, axis=1)
        keys = np.sort(np.stack([start.ravel(), end.ravel()], axis=1), axis=1)
        _, first, counts = np.unique(keys, axis=0, return_index=True, return_counts=True)
        once = first[counts == 1]

        def ends(of: FloatArray) -> tuple[FloatArray, FloatArray]:
            rows = of.reshape(-1, of.shape[2])
            return rows[once], np.roll(of, -1, axis=1).reshape(rows.shape)[once]

        self._flat, self._space = ends(flat), ends(space)

    def at(self, places: FloatArray) -> FloatArray:
        """Return where the outline's nearest points to places of the panel (N, 2) are in space, shape (N, 3)."""
        start, way = self._flat[0], self._flat[1] - self._flat[0]
        share = ((places[:, None] - start) * way).sum(axis=2) / (way**2).sum(axis=1)
        share = np.clip(share, 0.0, 1.0)
        off = np.linalg.norm(start + share[:, :, None] * way - places[:, None], axis=2)
        best = off.argmin(axis=1)
        held = share[np.arange(len(places)), best][:, None]
        return np.asarray((1.0 - held) * self._space[0][best] + held * self._space[1][best])


def _along(chain: Sequence[Side], placed: dict[str, tuple[Panel, _Rim]]) -> FloatArray:
    """Return places in space, evenly along a chain of edges."""
    edges = [placed[side.panel][0].edges[side.edge] for side in chain]
    ends = np.cumsum([0.0, *(curve_length(e.kind, e.points, e.bulge) for e in edges)])
    asked = np.linspace(0.0, ends[-1], _ASKED)
    owner = np.clip(np.searchsorted(ends, asked, side="right") - 1, 0, len(edges) - 1)
    found = np.empty((_ASKED, 3))
    for k, (side, edge) in enumerate(zip(chain, edges, strict=True)):
        mine = owner == k
        share = np.clip((asked[mine] - ends[k]) / (ends[k + 1] - ends[k]), 0.0, 1.0)
        flat = at_shares(edge.kind, edge.points, edge.bulge, share if side.forward else 1.0 - share[::-1])
        places = placed[side.panel][1].at(flat)
        found[mine] = places if side.forward else places[::-1]
    return found


def _corners(laid: FloatArray) -> IntArray:
    """Return numbers of the corners of triangles, the same where they lie in one place, shape (F, 3)."""
    _, corner = np.unique(np.round(laid.reshape(-1, 2) / _SAME_M).astype(np.int64), axis=0, return_inverse=True)
    return np.asarray(corner.reshape(-1, 3), dtype=np.int32)


def _pieces(laid: FloatArray, corner: IntArray) -> list[IntArray]:
    """Return the triangles of each panel, from left to right."""
    rows, columns = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(corner.max() + 1,) * 2)
    _, of = connected_components(links, directed=False)
    piece = of[corner[:, 0]]
    left = [laid[piece == k, :, 0].min() for k in range(piece.max() + 1)]
    return [np.flatnonzero(piece == k).astype(np.int32) for k in np.argsort(left)]
