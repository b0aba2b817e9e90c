"""Global intersection analysis: the part of a sheet that passed through another and must go back.

A contour cuts the sheets it lies on. Two floods rise from its two sides, and where they meet, the sheet is divided: by
the contour alone if it is closed, by the contour and the boundary if it ends there, and else by the straightest way on
from its end. The smaller part has come through (Baraff, Witkin & Kass 2003, "Untangling cloth", section 4; contours
that end at a boundary: Wicke, Lanker & Gross 2006, "Untangling cloth with boundaries").

Of the two sheets, that one is asked which the contour divides more cleanly, and whose part can go back in one
direction: a sleeve comes out of a sheet along its axis, while the disc in the sleeve would have to open. The other
sheet then gives way in the opposite direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.untangle.contours import Contours, Crossings
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.vector import dot, load, scale, sub

_CLEAR = 0.3
_ACROSS = 0.3  # cosine to the other sheet's direction, below which a crossing does not take part


class MeshGraph(NamedTuple):
    """A mesh as a graph of its vertices.

    Args:
        edges: Each once, the smaller vertex first, in lexicographic order, shape (E, 2).
        begins, at: Edges at each vertex as a compressed table, shapes (V + 1,) and (2E,).
        area: Of each vertex [m²], shape (V,).
    """

    edges: IntArray
    begins: IntArray
    at: IntArray
    area: FloatArray


class FloodSides(NamedTuple):
    """What the flood has found.

    Args:
        push: Direction in which an edge must move against the face it crosses, unit, or zero where the flood cannot
            tell, shape (N, 3).
        decided: Contours of which the flood could tell, shape (C,).
    """

    push: FloatArray
    decided: NDArray[np.bool_]


def mesh_graph(edges: IntArray, area: FloatArray) -> MeshGraph:
    """Return the graph of these edges, shape (E, 2), among vertices with these areas [m²], shape (V,)."""
    ends = edges.T.reshape(-1)
    order = np.argsort(ends, kind="stable")
    begins = np.searchsorted(ends[order], np.arange(len(area) + 1)).astype(np.int32)
    return MeshGraph(edges, begins, (order % len(edges)).astype(np.int32), area)


def flood_sides(sheet: MeshGraph, crossing: Crossings, contour: Contours, vertices: FloatArray) -> FloodSides:
    """Return where edges must go.

    Args:
        sheet: The cloth.
        crossing, contour: Of the cloth with itself.
        vertices: [m], shape (V, 3).
    """
    count = len(sheet.area)
    edge = np.searchsorted(
        sheet.edges[:, 0].astype(np.int64) * count + sheet.edges[:, 1],
        crossing.edge[:, 0].astype(np.int64) * count + crossing.edge[:, 1],
    )
    return FloodSides(*_flood(sheet, edge, crossing, contour, vertices))


@njit(cache=True, error_model="numpy")
def _flood(sheet, edge, crossing, contour, vertices):  # type: ignore[no-untyped-def]
    push = np.zeros((len(edge), 3))
    decided = np.zeros(len(contour.closed), np.bool_)
    cut = np.zeros(len(sheet.edges), np.int8)
    label = np.zeros(len(sheet.area), np.int8)
    queue = np.empty(len(sheet.area), np.int32)
    for c in range(len(contour.closed)):
        first, last = contour.first[c], contour.first[c + 1]
        best, chosen, smaller = 0.0, -1, 0
        for side in range(2):
            score, part = _score(sheet, edge, crossing, contour, vertices, first, last, side, cut, label, queue)
            if score > best:
                best, chosen, smaller = score, side, part
        if best > _CLEAR:
            decided[c] = True
            _directions(crossing, contour, c, np.int64(chosen), np.int64(smaller), push)
    return push, decided


@njit(cache=True, error_model="numpy")
def _score(sheet, edge, crossing, contour, vertices, first, last, side, cut, label, queue):  # type: ignore[no-untyped-def]
    """Return how well the contour divides this sheet (0 to 1), and the smaller part: 1 before its faces, 2 behind.

    The score is the share of the divide that the contour makes up, times the length of the mean of the directions.
    """
    for i in range(first, last):
        if contour.side[i] == side:
            cut[edge[contour.order[i]]] += 1
    label[:] = 0
    area = np.zeros(3)
    filled = taken = cuts = leaks = 0
    x = y = z = 0.0
    for i in range(first, last):
        n = contour.order[i]
        if contour.side[i] != side:
            continue
        normal = load(crossing.normal, n)
        x, y, z = x + normal[0], y + normal[1], z + normal[2]
        cuts += 1
        if cut[edge[n]] > 1:  # an edge that goes to and fro
            continue
        front = _front(vertices, crossing, n)
        for part in range(1, 3):
            v = crossing.edge[n, front if part == 1 else 1 - front]
            if label[v] == 0:
                label[v] = part
                queue[filled] = v
                filled += 1
    while taken < filled:
        v = queue[taken]
        taken += 1
        area[label[v]] += sheet.area[v]
        for j in range(sheet.begins[v], sheet.begins[v + 1]):
            e = sheet.at[j]
            if cut[e] % 2 == 1:
                continue
            w = sheet.edges[e, 1] if sheet.edges[e, 0] == v else sheet.edges[e, 0]
            if label[w] == 0:
                label[w] = label[v]
                queue[filled] = w
                filled += 1
            elif label[w] != label[v]:
                leaks += 1
    for i in range(first, last):
        if contour.side[i] == side:
            cut[edge[contour.order[i]]] = 0
    if area[1] == 0.0 or area[2] == 0.0:
        return 0.0, 0
    agreement = np.sqrt(x * x + y * y + z * z) / cuts
    return agreement * cuts / (cuts + 0.5 * leaks), 1 if area[1] <= area[2] else 2


@njit(cache=True, error_model="numpy")
def _directions(crossing, contour, c, chosen, smaller, push):  # type: ignore[no-untyped-def]
    """Write where the crossings of a contour must go, when this part of the chosen sheet has come through."""
    first, last = contour.first[c], contour.first[c + 1]
    ahead = -1
    for i in range(first, last):
        n = contour.order[i]
        if contour.side[i] == chosen:
            ahead = n
            sign = -1.0 if smaller == 1 else 1.0
            for d in range(3):
                push[n, d] = sign * crossing.normal[n, d]
    last_seen = ahead if contour.closed[c] else -1
    for i in range(first, last):
        n = contour.order[i]
        if contour.side[i] == chosen:
            last_seen = n
            continue
        j = i
        while last_seen < 0 and j < last:
            if contour.side[j] == chosen:
                last_seen = contour.order[j]
            j += 1
        normal = load(crossing.normal, n)
        along = -dot(normal, load(push, last_seen))
        if abs(along) > _ACROSS:
            way = scale(1.0 if along > 0.0 else -1.0, normal)
            push[n, 0], push[n, 1], push[n, 2] = way


@njit(cache=True, error_model="numpy")
def _front(vertices, crossing, n):  # type: ignore[no-untyped-def]
    """Return the end of the edge, 0 or 1, that is before the face."""
    along = sub(load(vertices, crossing.edge[n, 1]), load(vertices, crossing.edge[n, 0]))
    return 1 if dot(along, load(crossing.normal, n)) > 0.0 else 0
