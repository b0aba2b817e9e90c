"""Limbs of a body of any pose: what stands out from its middle, and the way in along each.

The distance over the skin from a belt about the body's middle has a maximum at the end of each limb. A limb is what
lies farther than the level at which it joins another (persistence of maxima; Edelsbrunner, Letscher & Zomorodian 2002).
Its axis goes through the centres of the bands between levels (Verroust & Lazarus 2000, "Extracting skeletal curves from
3D scattered data"). On a body so thin that a limb is a line, the shortest way over the skin from its end to the belt
runs along that line, and on inside the trunk. No landmark and no template is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_BAND = 0.015  # of the body's height: distance between levels, and between the points of an axis
_STANDS_OUT = 0.1  # of the body's height: shorter ones are fingers, a nose, a bun
_ROOT = 0.08  # of the body's height: how far a shoulder or a hip goes on within the trunk
_STRAIGHT = 5  # bands at the end of a limb that tell its direction there
_END = 0.1  # of the body's height: from the tip of a hand over the skin to its wrist
_SHIN = 0.25  # of the body's height: from the toes over the skin to the middle of the shin
_FOOT = 0.05  # of the body's height: how far toes are in front of it at least
_BELT = 0.02  # of the body's height: half of the belt's width


class Limb(NamedTuple):
    """A limb of a body.

    Args:
        name: "left arm", or "limb" where the body has others than a head, two arms and two legs.
        tip: Vertex at its end.
        axis: Points along its middle, from its end to where it joins the body and straight on from there [m], (N, 3).
        along: Length over the skin from its end to each of them [m], shape (N,).
        joins: The same to where it joins the body [m].
        members: Which vertices of the body belong to it, shape (V,).
    """

    name: str
    tip: int
    axis: FloatArray
    along: FloatArray
    joins: float
    members: NDArray[np.bool_]

    @property
    def root(self) -> FloatArray:
        """Where its axis comes to the body [m], shape (3,)."""
        return self.axis[self.along <= self.joins][-1]


class Limbs:
    """The limbs of a body, +Y up, the highest first.

    Args:
        body: Only the piece about its middle counts [m].
    """

    def __init__(self, body: TriangleMesh) -> None:
        height = float(np.ptp(body.vertices[:, 1]))
        self._graph, self._band, self._height = _graph(body), _BAND * height, height
        self._area = laplacian(body)[1]
        self._belt = self._middle_belt(body, _BELT * height)
        self.limbs: list[Limb] = []
        if len(self._belt) == 0 or height == 0.0:  # as coarse as a box, or flat: nothing stands out
            return
        away = distance_from(body, self._belt, np.inf)
        self._away = away = np.where(np.isfinite(away), away, -1.0)
        levels = np.arange(away.max(), 0.0, -self._band)
        found = _standing_out(self._graph, away, levels, _STANDS_OUT * height)
        limbs = [self._limb(body, away, tip, members, _ROOT * height) for tip, members in found]
        self.limbs = _named(body, sorted(limbs, key=lambda limb: -float(body.vertices[limb.tip, 1])))

    def _limb(self, body: TriangleMesh, away: FloatArray, tip: int, members: NDArray[np.bool_], root: float) -> Limb:
        """Return a limb, its axis through the centres of its bands, then straight on into the body."""
        area = self._area
        of_band = ((away[tip] - away[members]) / self._band).astype(np.int64)
        weight = np.bincount(of_band, area[members])
        filled = np.flatnonzero(weight)
        summed = np.stack([np.bincount(of_band, area[members] * x) for x in body.vertices[members].T], axis=1)
        axis = np.vstack([body.vertices[tip], summed[filled] / weight[filled, None]])
        along = np.append(0.0, self._band * (filled + 0.5))
        inward = axis[-1] - axis[max(0, len(axis) - 1 - _STRAIGHT)]
        inward /= max(float(np.linalg.norm(inward)), 1e-12)
        on = np.arange(1, int(root / self._band) + 1)[:, None] * self._band * inward
        joins = float(along[-1])
        along = np.append(along, joins + self._band * np.arange(1, len(on) + 1))
        return Limb("limb", tip, np.vstack([axis, axis[-1] + on]), along, joins, members)

    def _middle_belt(self, body: TriangleMesh, half: float) -> IntArray:
        """Return the vertices of the largest piece of a level slice through the body's middle."""
        heights = body.vertices[:, 1]
        level = np.flatnonzero(np.abs(heights - 0.5 * (heights.min() + heights.max()) - half) <= half)
        if len(level) == 0:
            return level.astype(np.int32)
        _, piece = connected_components(self._graph[level][:, level], directed=False)
        return level[piece == np.bincount(piece, self._area[level]).argmax()].astype(np.int32)

    def ends(self) -> list[IntArray]:
        """Return the vertices of the end of each limb, of a hand or the front of a foot, shape (N,) each."""
        least = [self._away[limb.tip] - _END * self._height for limb in self.limbs]
        return [
            np.flatnonzero(limb.members & (self._away >= level)).astype(np.int32)
            for limb, level in zip(self.limbs, least, strict=True)
        ]

    @property
    def parting(self) -> float:
        """Height at which the legs part [m]; minus infinity where no two legs are known."""
        legs = [limb for limb in self.limbs if limb.name.endswith("leg")]
        tops = [float(limb.root[1]) for limb in legs]
        return sum(tops) / len(tops) if tops else -np.inf

    @property
    def ahead(self) -> FloatArray:
        """Where the feet point, level and of unit length, shape (3,); +Z where there are none."""
        ways = [
            limb.axis[0] - limb.axis[min(int(np.searchsorted(limb.along, _SHIN * self._height)), len(limb.axis) - 1)]
            for limb in self.limbs
            if limb.name.endswith("leg")
        ]
        way = np.mean(ways, axis=0) * [1.0, 0.0, 1.0] if ways else np.zeros(3)
        length = float(np.linalg.norm(way))
        return way / length if length > _FOOT * self._height else np.array([0.0, 0.0, 1.0])

    def ways_in(self, thin: TriangleMesh) -> list[FloatArray]:
        """Return the shortest ways over the skin from the end of each limb to the belt [m], shape (N, 3) each.

        Args:
            thin: The same triangles, of a body so thin that the skin runs along the middle of each limb.
        """
        if not self.limbs:
            return []
        graph, x = self._graph, thin.vertices
        length = np.linalg.norm(x[graph.indices] - np.repeat(x, np.diff(graph.indptr), axis=0), axis=1)
        graph = csr_matrix((np.maximum(length, 1e-9), graph.indices, graph.indptr), graph.shape)
        away, before = dijkstra(graph, indices=[limb.tip for limb in self.limbs], return_predecessors=True)
        ways = []
        for limb, far, back in zip(self.limbs, away, before, strict=True):
            way = [int(self._belt[np.argmin(far[self._belt])])]
            while way[-1] != limb.tip:
                way.append(int(back[way[-1]]))
            ways.append(x[way[::-1]])
        return ways


def _graph(mesh: TriangleMesh) -> csr_matrix:
    """Return which vertices are joined by an edge, symmetric, shape (V, V)."""
    pair, count = edges(mesh), len(mesh.vertices)
    return coo_matrix((np.ones(2 * len(pair)), (pair.reshape(-1), pair[:, ::-1].reshape(-1))), (count, count)).tocsr()


def _standing_out(
    graph: csr_matrix, away: FloatArray, levels: FloatArray, least: float
) -> list[tuple[int, NDArray[np.bool_]]]:
    """Return the maxima that stand out by at least so much, and what lies about each above where it joins another."""
    pieces: list[IntArray] = []
    lowest: dict[int, float] = {}
    for level in levels[1:]:
        above = np.flatnonzero(away > level)
        count, piece = connected_components(graph[above][:, above], directed=False)
        whole = np.full(len(away), -1, np.int32)
        whole[above] = piece
        pieces.append(whole)
        order = np.lexsort((above, -away[above], piece))
        highest = above[order[np.searchsorted(piece[order], np.arange(count))]]
        lowest.update(dict.fromkeys(highest.tolist(), float(level)))
    tips = [tip for tip, level in lowest.items() if away[tip] - level >= least]
    members = {tip: np.zeros(len(away), np.bool_) for tip in tips}
    for whole in pieces:
        for tip in tips:
            if whole[tip] >= 0 and (whole[tips] == whole[tip]).sum() == 1:
                members[tip] = whole == whole[tip]
    return list(members.items())


def _named(body: TriangleMesh, limbs: list[Limb]) -> list[Limb]:
    """Return the limbs of a standing figure with their names, by height and side: the wearer's left is +X."""
    if len(limbs) != 5:
        return limbs
    side = np.array([body.vertices[limb.tip, 0] for limb in limbs])
    side -= np.median(side)
    head = int(np.argmin(np.abs(side[:3])))  # hands may be higher
    names = [f"{'left' if x > 0.0 else 'right'} {'leg' if k > 2 else 'arm'}" for k, x in enumerate(side)]
    names[head] = "head"
    return [limb._replace(name=name) for limb, name in zip(limbs, names, strict=True)]
