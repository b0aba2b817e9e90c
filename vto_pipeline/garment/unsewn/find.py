"""Seams for a garment whose own are not known: where its type has them, along the shortest ways between its openings.

They need not be where the cloth was sewn. The pattern they make is one of the many that the same garment can be sewn
from.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.unsewn.rims import Rims
from vto_pipeline.geometry.section import plane_section
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_BENT = 0.1  # of its length: a side line that is straighter than this goes round no armpit, so there is no sleeve
_OUT_M = (0.01, 0.02, 0.03, 0.05)  # from the armpit along the sleeve
_ROUND = 1.3  # times its width between armpit and shoulder: a longer curve goes down the body
_PIECES = 4  # of an edge

Lines = dict[str, FloatArray]


def find_seams(mesh: TriangleMesh, rims: Rims) -> Lines:
    """Return lines on a garment along which it comes apart into pieces that can be laid flat, name -> points (K, 3).

    Args:
        mesh: The garment, worn upright, +Y up, +Z the front.
        rims: Its openings.

    Raises:
        GarmentError: its shape is none of the type.
    """
    return {"top": _top, "trousers": _trousers, "skirt": _skirt}[rims.kind](mesh, rims.loops)


def _skirt(mesh: TriangleMesh, loops: Mapping[str, IntArray]) -> Lines:
    found, ways = {}, _Ways(mesh)
    for name, side in _SIDES.items():
        ends = [_farthest(mesh, loops[rim], [side, 0.0, 0.0]) for rim in ("waist", "hem")]
        found[f"{name} side"] = ways.shortest(*ends)
    return found


def _trousers(mesh: TriangleMesh, loops: Mapping[str, IntArray]) -> Lines:
    middle = _middle(mesh)
    waist = mesh.vertices[loops["waist"]]
    crotch = _curve(mesh, np.array([middle, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), waist.mean(axis=0), "the crotch")
    lowest = int(np.linalg.norm(mesh.vertices - crotch[crotch[:, 1].argmin()], axis=1).argmin())
    found, ways = {"crotch": crotch}, _Ways(mesh)
    for name, side in _SIDES.items():
        hem = loops[f"{name}_hem"]
        top = _farthest(mesh, loops["waist"], [side, 0.0, 0.0])
        found[f"{name} outseam"] = ways.shortest(top, _farthest(mesh, hem, [side, 0.0, 0.0]))
        found[f"{name} inseam"] = ways.shortest(lowest, _farthest(mesh, hem, [-side, 0.0, 0.0]))
    return found


def _top(mesh: TriangleMesh, loops: Mapping[str, IntArray]) -> Lines:
    found, armholes, ways = {}, {}, _Ways(mesh)
    for name, side in _SIDES.items():
        cuff = loops[f"{name}_cuff"]
        along = _axis(mesh, cuff)
        inward = np.array([-side, -1.0, 0.0])
        inward -= (inward @ along) * along
        under = ways.shortest(_farthest(mesh, cuff, inward), _farthest(mesh, loops["hem"], [side, 0.0, 0.0]))
        over = ways.shortest(_farthest(mesh, loops["neck"], [side, 0.0, 0.0]), _farthest(mesh, cuff, -inward))
        found[f"{name} side"], found[f"{name} shoulder"] = under, over
        armpit, depth = _bend(under)
        if depth > _BENT:
            armholes[f"{name} armhole"] = _armhole(mesh, under[: armpit + 1], over, name)
    return found | armholes


_SIDES = {"left": 1.0, "right": -1.0}  # the wearer's


def _middle(mesh: TriangleMesh) -> float:
    return float(0.5 * (mesh.vertices[:, 0].min() + mesh.vertices[:, 0].max()))


def _farthest(mesh: TriangleMesh, loop: IntArray, way: FloatArray | list[float]) -> int:
    return int(loop[int(np.argmax(mesh.vertices[loop] @ np.asarray(way)))])


def _axis(mesh: TriangleMesh, loop: IntArray) -> FloatArray:
    """Return the unit normal of the area that a loop encloses, shape (3,)."""
    points = mesh.vertices[loop] - mesh.vertices[loop].mean(axis=0)
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    return np.asarray(normal / np.linalg.norm(normal))


def _bend(line: FloatArray) -> tuple[int, float]:
    """Return which point of a line is farthest from the straight way between its ends, and how far for its length."""
    way = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
    off = line - line[0]
    apart = np.linalg.norm(off - (off @ way)[:, None] * way, axis=1)
    return int(apart.argmax()), float(apart.max() / np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _armhole(mesh: TriangleMesh, under: FloatArray, over: FloatArray, name: str) -> FloatArray:
    """Return the curve around a sleeve at its root: the nearest to the armpit that does not go down the body."""
    high = over[_shoulder(over, under[-1])]
    to_armpit = np.linalg.norm(np.diff(under, axis=0), axis=1)[::-1].cumsum()[::-1]
    for out in _OUT_M:
        if to_armpit[0] > out:
            low = under[np.flatnonzero(to_armpit > out)[-1]]
            normal = np.cross(high - low, [0.0, 0.0, 1.0])
            curve = _curve(mesh, low, normal, 0.5 * (low + high), f"the {name} armhole")
            way = (high - low) / np.linalg.norm(high - low)
            if np.ptp(curve @ way) < _ROUND * np.linalg.norm(high - low):
                return curve
    raise GarmentError(f"the {name} sleeve does not part from the body", hint="draw the seams: --seams FILE")


def _shoulder(over: FloatArray, armpit: FloatArray) -> int:
    """Return where a set-in sleeve ends: half way from right above the armpit to where the sleeve is narrowest."""
    above = int(np.abs(over[:, 0] - armpit[0]).argmin())
    narrowest = int(np.linalg.norm(over - armpit, axis=1).argmin())
    return (above + narrowest) // 2


class _Ways:
    """Shortest ways on a surface, along its edges and straight through faces between a few points of their sides.

    With four pieces to an edge, a way is longer than the shortest by less than two percent (Lanthier, Maheshwari & Sack
    1997, "Approximating weighted shortest paths on polyhedral surfaces").
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        pair, count = edges(mesh), len(mesh.vertices)
        shares = np.arange(1, _PIECES) / _PIECES
        a, b = (mesh.vertices[pair[:, k]] for k in range(2))
        between = a[:, None] + shares[:, None] * (b - a)[:, None]
        self._points = np.concatenate([mesh.vertices, between.reshape(-1, 3)])
        key = pair[:, 0].astype(np.int64) * count + pair[:, 1]
        halves = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2).astype(np.int64)
        edge = np.searchsorted(key, halves[..., 0] * count + halves[..., 1])  # (F, 3)
        inner = count + edge[..., None] * len(shares) + np.arange(len(shares))
        around = np.concatenate([mesh.faces, inner.reshape(len(mesh.faces), -1)], axis=1)
        i, j = np.triu_indices(around.shape[1], 1)
        one, other = around[:, i].ravel(), around[:, j].ravel()
        low, high = np.minimum(one, other), np.maximum(one, other)
        low, high = np.divmod(np.unique(low.astype(np.int64) * len(self._points) + high), len(self._points))
        length = np.linalg.norm(self._points[low] - self._points[high], axis=1)
        self._graph = coo_array((length, (low, high)), shape=(len(self._points),) * 2).tocsr()

    def shortest(self, start: int, end: int) -> FloatArray:
        """Return the way from vertex to vertex, shape (K, 3)."""
        far, before = dijkstra(self._graph, directed=False, indices=start, return_predecessors=True)
        if not np.isfinite(far[end]):
            raise GarmentError("the garment is in several pieces", hint="give each piece by itself, or draw the seams")
        way = [end]
        while way[-1] != start:
            way.append(int(before[way[-1]]))
        return np.asarray(self._points[way[::-1]])


def _curve(mesh: TriangleMesh, origin: FloatArray, normal: FloatArray, about: FloatArray, what: str) -> FloatArray:
    """Return the curve, in order, in which a plane cuts a garment, of several the nearest to a point, shape (K, 3)."""
    cut = plane_section(mesh, origin, normal)
    if len(cut.points) == 0:
        raise GarmentError(f"{what} is not where a garment of this type has it", hint="draw the seams: --seams FILE")
    size = np.bincount(cut.curve)
    nearest = np.full(len(size), np.inf)
    middles = np.stack([np.bincount(cut.curve, cut.points[:, k]) / size for k in range(3)], axis=1)
    long = size > 8
    nearest[long] = np.linalg.norm(middles[long] - about, axis=1)
    return _in_order(cut.points, cut.segments[cut.curve[cut.segments[:, 0]] == int(nearest.argmin())])


def _in_order(points: FloatArray, segments: IntArray) -> FloatArray:
    links: dict[int, list[int]] = {}
    for a, b in segments.tolist():
        links.setdefault(a, []).append(b)
        links.setdefault(b, []).append(a)
    loose = sorted(k for k, near in links.items() if len(near) == 1)
    first = loose[0] if loose else min(links)
    way, last = [first], -1
    while True:
        ahead = [k for k in links[way[-1]] if k != last]
        if not ahead or (len(way) > 1 and ahead[0] == first):
            break
        last = way[-1]
        way.append(ahead[0])
    return np.asarray(points[way if loose else [*way, first]])
