"""Notches in the rim of an opening: scan holes that happen to reach it, as at the underside of a sleeve."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.garment.loop_evidence import RIM_OUTSIDE, encloses, outside_share, passes_through
from vto_pipeline.garment.rims import smooth_curve
from vto_pipeline.geometry.remeshing.holes import fill_notch
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_walks, face_components, face_normals, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

OverBare = Callable[[FloatArray], bool]

DETOUR = 1.6
"""A rim whose way round a notch is so many times longer than across is notched; half a circle is π/2."""
LEAST_DETOUR, LEAST_DEPTH = 0.03, 0.012
"""Smaller notches are left to the fairing of rims [m]. Depth is into the garment: folds of a hem are no notches."""
ROUNDER = 1.1
"""A rim must become rounder by this factor when its notch is closed."""
GRAZING = 0.15
"""The closing line may cut a curved mannequin by this share of its width, as over a shoulder."""
TANGENT = 0.02
"""The direction of a rim beside a notch is taken over this length [m]."""
LOOKED_AT = 120
"""Points of each rim between which notches are looked for."""
TRIED = 2000
"""Candidates that are looked at."""
ROUNDS = 3
"""How often notches are looked for: one rim may have several."""
OVER_CLOTH, NEARER = 0.5, 0.5
"""The line across a notch runs over nothing, and the nearest cloth is the rim. Less than this share of it may be over
cloth, which is where cloth is so many times nearer than the rim: behind a collar, from one scan hole to the next."""
IN_SHEET = 0.3
"""What closes a notch runs on as the cloth beside it does: the mean cosine between their normals is larger. Round a
sleeve that is open along two fifths of its way round it is 0.3; what closes a part of a tube's mouth has 0 or less."""
WAVELENGTH = 0.025
"""Notches are looked for on the rim without its zigzag [m]."""


def close_notches(
    mesh: TriangleMesh, distance: SurfaceDistance, over_bare: OverBare, least_perimeter: float, reach: float
) -> tuple[TriangleMesh, int]:
    """Return the mesh with the notches of its rims filled, and how many there were.

    The line across a notch runs outside the mannequin or grazes it, and the rim that is left goes round the mannequin.
    What closes it runs on as the cloth beside it: what would close a part of the opening stands across the cloth.
    What would cover mannequin that was seen bare is no notch but the shape of the rim, as the V of an open collar.
    Where the mannequin passes through what the line cuts off, that is the opening, and the hole is on its other side.
    A line along cloth is not across a notch: it would cut a part of the true rim off, with a second layer below it.

    Args:
        mesh: The garment.
        distance: Signed distances to the mannequin.
        over_bare: Whether points (N, 3), spread over what would close a notch, lie over mannequin that was seen bare.
        least_perimeter: Shorter loops are not looked at [m].
        reach: How far inside an opening the mannequin may end [m].
    """
    closed = 0
    done: set[bytes] = set()  # rims without a notch, by their vertices, which keep their numbers
    for _ in range(ROUNDS):
        notches = []
        for walk in boundary_walks(mesh):
            rim = np.sort(half_edges(mesh)[walk, 0]).tobytes()
            if rim in done or _length(mesh, walk) <= least_perimeter:
                continue
            notch = _tightest_notch(mesh, walk, distance, over_bare, least_perimeter, reach)
            if notch is None:
                done.add(rim)
            else:
                notches.append(notch)
        for around, directions in notches:
            mesh = _fill_smoothly(mesh, around, directions)
        if not notches:
            break
        closed += len(notches)
    return mesh, closed


def _length(mesh: TriangleMesh, walk: IntArray) -> float:
    start, end = half_edges(mesh)[walk].T
    return float(np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1).sum())


def _tightest_notch(
    mesh: TriangleMesh,
    walk: IntArray,
    distance: SurfaceDistance,
    over_bare: OverBare,
    least_perimeter: float,
    reach: float,
) -> tuple[IntArray, FloatArray] | None:
    """Return the half-edges round the notch that leaves the shortest rim, and the directions in which that comes to it
    and goes on after it, shape (2, 3); None when there is no notch.

    Under an arm the longer ways round it go along the flank, and would web it to the sleeve. Every other place of the
    rim is looked at, then the places beside the best.
    """
    points = mesh.vertices[half_edges(mesh)[walk, 0]]
    beside = face_normals(mesh)[walk // 3]
    piece = face_components(mesh)[1]  # a jacket's rim may run over trousers
    mine = np.unique(mesh.faces[piece == piece[walk[0] // 3]])
    cloth, rim_there = cKDTree(mesh.vertices[mine]), cKDTree(points)
    for _ in range(2):
        points = smooth_curve(points, WAVELENGTH)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))])
    at = np.unique(np.searchsorted(along[:-1], np.arange(LOOKED_AT) / LOOKED_AT * along[-1]).clip(max=len(walk) - 1))

    def directions_at(start: int, end: int) -> FloatArray:
        before = points[start] - points[_index_along(along, start, -TANGENT)]
        after = points[_index_along(along, end, TANGENT)] - points[end]
        return np.stack([before, after]) / np.linalg.norm([before, after], axis=1, keepdims=True)

    def is_notch(start: int, end: int) -> bool:
        left = at[np.argsort(np.mod(at - end, len(walk)))]  # from the notch's end round to its start
        left = left[: np.count_nonzero(np.mod(at - end, len(walk)) <= np.mod(start - end, len(walk)))]
        share = np.linspace(0.0, 1.0, 12)[1:-1, None]
        closing_line = points[start] + share * (points[end] - points[start])
        rim = np.vstack([points[left], closing_line])
        if not encloses(rim, distance, reach):  # asked first, as nearly all candidates fail it
            return False
        if over_bare(_between(points, along, start, end)):
            return False
        curve = _closing_curve(points[start], points[end], directions_at(start, end), share)
        if runs_over_cloth(curve, cloth, rim_there):
            return False
        path = _path(points, start, end)
        cut_off = np.vstack([path[:: 1 + len(path) // LOOKED_AT], closing_line[::-1]])
        return outside_share(rim, distance) >= RIM_OUTSIDE and not passes_through(cut_off, distance)

    def shortest(which: NDArray[np.bool_]) -> int | None:
        best = None
        for k in np.flatnonzero(which):
            if (best is None or length_left[k] < length_left[best]) and is_notch(*candidates[k]):
                best = int(k)
        return best

    candidates = _candidate_notches(points, beside, along, at, distance, least_perimeter)[:TRIED]
    if not candidates:
        return None
    begin, finish = np.array(candidates).T
    length_left = along[-1] - np.mod(along[finish] - along[begin], along[-1])
    length_left += np.linalg.norm(points[finish] - points[begin], axis=1)
    place = np.searchsorted(at, np.array(candidates))
    every_other = np.all(place % 2 == 0, axis=1)
    best = shortest(every_other)
    if best is None:
        best = shortest(~every_other)
    else:
        apart = np.abs(place - place[best])
        best = shortest(np.all(np.minimum(apart, len(at) - apart) <= 2, axis=1))
    if best is None:
        return None
    start, end = candidates[best]
    notch = np.roll(walk, -start)[: (end - start) % len(walk)]
    return notch, directions_at(start, end)


def runs_over_cloth(curve: FloatArray, cloth: cKDTree, rim: cKDTree) -> bool:
    """Return whether a curve (N, 3) runs over cloth, and not over a gap in its rim.

    Args:
        curve: From one place of the rim to another.
        cloth: All vertices.
        rim: Those of the rim.
    """
    return bool(np.mean(cloth.query(curve)[0] < NEARER * rim.query(curve)[0]) >= OVER_CLOTH)


def _path(points: FloatArray, start: int, end: int) -> FloatArray:
    """Return the points of a rim from one place on to another, shape (N, 3)."""
    return np.roll(points, -start, axis=0)[: (end - start) % len(points) + 1]


def _between(points: FloatArray, along: FloatArray, start: int, end: int) -> FloatArray:
    """Return points spread over what would close a notch: from the rim round it to the line across, shape (N, 3)."""
    share = np.linspace(0.0, 1.0, 25)[1:-1]
    arc = np.mod(along[end] - along[start], along[-1])
    rim = points[np.searchsorted(along[:-1], np.mod(along[start] + share * arc, along[-1])) % len(points)]
    line = points[start] + share[:, None] * (points[end] - points[start])
    return np.concatenate([rim + inwards * (line - rim) for inwards in (0.25, 0.5, 0.75)])


def _candidate_notches(
    points: FloatArray,
    beside: FloatArray,
    along: FloatArray,
    at: IntArray,
    distance: SurfaceDistance,
    least_perimeter: float,
) -> list[tuple[int, int]]:
    """Return where notches may start and end, first what leaves the roundest rim: greatest 4π area / perimeter²."""
    steps = np.arange(1, len(at) - 1)
    i, j = at[:, None], at[(np.arange(len(at))[:, None] + steps) % len(at)]
    arc = np.mod(along[j] - along[i], along[-1])
    across = np.linalg.norm(points[j] - points[i], axis=2)
    height = points @ _axis(points)
    depth = 0.5 * (height[i] + height[j]) - np.minimum.accumulate(height[j], axis=1)
    left = along[-1] - arc + across
    whole, cut_off = _area_vector(points), _cut_off(points, i, j)
    round_left = 4.0 * np.pi * np.linalg.norm(whole - cut_off, axis=-1) / np.square(left)
    rounder = round_left > ROUNDER * 4.0 * np.pi * np.linalg.norm(whole) / along[-1] ** 2
    notch = (arc - DETOUR * across > LEAST_DETOUR) & (depth > LEAST_DEPTH)
    runs_on = in_sheet(cut_off, beside * np.diff(along)[:, None], i, j) > IN_SHEET * arc
    row, column = np.nonzero(notch & runs_on & (left > least_perimeter) & rounder)
    free = _outside(points[at[row]], points[j[row, column]], distance)
    row, column = row[free], column[free]
    order = np.argsort(-round_left[row, column], kind="stable")
    return [(int(at[r]), int(j[r, c])) for r, c in zip(row[order], column[order], strict=True)]


def _cut_off(points: FloatArray, start: IntArray, end: IntArray) -> FloatArray:
    """Return the area vectors of what straight lines cut off a rim, from each start to its end, shape (..., 3)."""
    swept = _sums(0.5 * np.cross(points, np.roll(points, -1, axis=0)), start, end)
    return np.asarray(swept + 0.5 * np.cross(points[end], points[start]))


def in_sheet(area: FloatArray, beside: FloatArray, start: IntArray, end: IntArray) -> FloatArray:
    """Return how far notches run on as the cloth does: the mean cosine of their normals times the way round [m].

    Args:
        area: Area vector of each, along the rim [m²], shape (..., 3).
        beside: Normals of the faces at the rim, each as long as its edge there [m], shape (L, 3).
        start, end: Of the notches, along the rim.
    """
    outward = -area / np.maximum(np.linalg.norm(area, axis=-1, keepdims=True), 1e-12)
    return np.asarray((_sums(beside, start, end) * outward).sum(axis=-1))


def _sums(steps: FloatArray, start: IntArray, end: IntArray) -> FloatArray:
    """Return the sums of steps (L, 3) round a loop, from each start to its end, shape (..., 3)."""
    until = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return np.asarray(until[end] - until[start] + np.where((end < start)[..., None], until[-1], 0.0))


def _axis(points: FloatArray) -> FloatArray:
    """Return the unit normal of the disc in a rim, out of the garment: a filling runs against the boundary."""
    area = _area_vector(points)
    return -area / np.linalg.norm(area)


def _area_vector(points: FloatArray) -> FloatArray:
    return 0.5 * np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)


def _index_along(along: FloatArray, place: int, by: float) -> int:
    """Return the place on a rim by so much further along [m]."""
    return int(np.searchsorted(along[:-1], np.mod(along[place] + by, along[-1])) % (len(along) - 1))


def _fill_smoothly(mesh: TriangleMesh, notch: IntArray, directions: FloatArray) -> TriangleMesh:
    """Fill a notch up to the curve that goes on as the rim does on both sides of it."""
    halves = half_edges(mesh)
    first, last = halves[notch[0], 0], halves[notch[-1], 1]
    start, end = mesh.vertices[first], mesh.vertices[last]
    edge = np.linalg.norm(mesh.vertices[halves[notch, 1]] - mesh.vertices[halves[notch, 0]], axis=1).mean()
    t = np.linspace(0.0, 1.0, int(np.ceil(1.1 * np.linalg.norm(end - start) / edge)) + 1)[1:-1, None]
    return fill_notch(mesh, notch, _closing_curve(start, end, directions, t))


def _closing_curve(start: FloatArray, end: FloatArray, directions: FloatArray, t: FloatArray) -> FloatArray:
    """Return points on the Hermite cubic from one end of a notch to the other, shape (N, 3).

    Its tangents are as long as those that make it a circle's arc, were the turn between them one.

    Args:
        start, end: [m], shape (3,).
        directions: In which it starts and ends, shape (2, 3).
        t: From 0 to 1, shape (N, 1).
    """
    turn = np.arccos(np.clip(directions[0] @ directions[1], -0.5, 1.0))
    pull = directions * float(np.linalg.norm(end - start)) / np.cos(turn / 4.0) ** 2
    curve = (2 * t**3 - 3 * t**2 + 1) * start + (t**3 - 2 * t**2 + t) * pull[0]
    return np.asarray(curve + (3 * t**2 - 2 * t**3) * end + (t**3 - t**2) * pull[1])


def _outside(start: FloatArray, end: FloatArray, distance: SurfaceDistance) -> NDArray[np.bool_]:
    """Return which straight lines hardly go into the mannequin, shape (N,)."""
    share = np.linspace(0.1, 0.9, 9)[:, None, None]
    line = (1.0 - share) * start + share * end
    clearance = distance.signed(line.reshape(-1, 3)).distance.reshape(len(share), -1)
    return clearance.min(axis=0, initial=np.inf) > -GRAZING * np.linalg.norm(end - start, axis=1)
