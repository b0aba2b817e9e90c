"""Straps that photos show and the scan lost, put back between their ends; so are large bites in a rim.

Stereo sees no top of a shoulder from below it, and a strap is torn there: neck and armhole are one rim. Along its torn
ends photos show that the cloth goes on. What lies between the ends is filled as a hole is, up to where photos show the
mannequin bare beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.lifting import KeptOutside
from vto_pipeline.garment.photographed.parted import AT_RIM, BESIDE, LEAST_LOST, lost_patches
from vto_pipeline.garment.photographed.sightings import SPACING, Sightings
from vto_pipeline.geometry.remeshing.holes import fill_between
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_walks, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

OVER_STRAP = 5.0
"""A border runs over a strap, instead of beside it, where another way is so many times longer."""


def bridge_straps(
    mesh: TriangleMesh,
    sightings: Sightings,
    distance: SurfaceDistance,
    least_perimeter: float,
    clearance: float,
    job: Job,
) -> TriangleMesh:
    """Return the garment with the straps that photos show; its old vertices and faces come first.

    Smaller bites are left to `close_notches`, which goes on as the rim beside them does.

    Args:
        mesh: The garment, its rims clean and its holes open.
        sightings: What photos show where it leaves the mannequin bare.
        distance: Signed distances to the mannequin [m].
        least_perimeter: No opening is shorter [m].
        clearance: Least distance of what is filled from the mannequin [m].
        job: Receives a warning for each strap.
    """
    bare = sightings.points[~sightings.cloth]
    for strap in lost_patches(sightings, mesh.vertices):
        if strap.parts < 2 and strap.area < LEAST_LOST:
            continue
        arcs = _torn_ends(mesh, strap.cloth, bare, strap.parts, least_perimeter)
        if len(arcs) == 0:
            continue
        ends = half_edges(mesh)
        lines = []
        for arc, before in zip(arcs, [arcs[-1], *arcs[:-1]], strict=True):
            start, end = mesh.vertices[ends[arc[0], 0]], mesh.vertices[ends[before[-1], 1]]
            edge = np.linalg.norm(np.diff(mesh.vertices[ends[arc]], axis=1), axis=2).mean()
            lines.append(_border(start, end, strap.cloth, bare, distance, clearance, float(edge)))
        x, y, z = strap.cloth.mean(axis=0)
        what = f"{strap.area * 1e4:.0f} cm² of cloth at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        try:
            mesh = fill_between(mesh, arcs, lines)
        except GarmentError as error:
            job.note(f"photos show {what} that the scan lacks; it could not be bridged: {error}")
            continue
        job.warn(f"photos show {what} that the scan lacks; it was put back, and where its rims run is uncertain")
    return mesh


def _torn_ends(
    mesh: TriangleMesh, cloth: FloatArray, bare: FloatArray, parts: int, least_perimeter: float
) -> list[IntArray]:
    """Return the half-edges along which one rim was torn from lost cloth, in its order: an arc for each end.

    Args:
        mesh: The garment.
        cloth: Points of the mannequin under the lost cloth [m], shape (N, 3).
        bare: Points of it that photos show bare [m], shape (M, 3).
        parts: How many parts of the mannequin the lost cloth lies between, each of which leaves through a rim of its
            own.
        least_perimeter: No rim is shorter [m].
    """
    halves, lost, shown = half_edges(mesh), cKDTree(cloth), cKDTree(bare)
    best: list[IntArray] = []
    for walk in boundary_walks(mesh):
        ends = mesh.vertices[halves[walk]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        middle = ends.mean(axis=1)
        away = lost.query(middle)[0]
        arcs = _runs((away < shown.query(middle)[0]) & (away < AT_RIM))
        arcs = _without_gaps(arcs, walk, mesh.vertices[halves[walk, 0]], length, least_perimeter)
        arcs = sorted(sorted(arcs, key=lambda arc: -length[arc].sum())[:parts], key=lambda arc: int(arc[0]))
        if sum(map(len, arcs)) > sum(map(len, best)):
            best = [walk[arc] for arc in arcs]
    return best


def _runs(torn: NDArray[np.bool_]) -> list[IntArray]:
    """Return the places of each run round a closed walk (L,), none where all or nothing is torn."""
    first = np.flatnonzero(torn & ~np.roll(torn, 1))
    last = np.flatnonzero(torn & ~np.roll(torn, -1))
    if len(first) == 0:
        return []
    if last[0] < first[0]:
        last = np.roll(last, -1)
    count = (last - first) % len(torn) + 1
    return [((k + np.arange(n)) % len(torn)).astype(np.int32) for k, n in zip(first, count, strict=True)]


def _without_gaps(
    arcs: list[IntArray], walk: IntArray, points: FloatArray, length: FloatArray, least_perimeter: float
) -> list[IntArray]:
    """Return arcs joined across what would be no rim: with the line from end to end, it is too short."""
    while len(arcs) > 1:
        across = []
        for arc, after in zip(arcs, [*arcs[1:], arcs[0]], strict=True):
            start, end = (int(arc[-1]) + 1) % len(walk), int(after[0])
            gap = (start + np.arange((end - start) % len(walk))) % len(walk)
            across.append((length[gap].sum() + np.linalg.norm(points[end] - points[start]), gap))
        narrowest = min(range(len(arcs)), key=lambda k: across[k][0])
        if across[narrowest][0] >= least_perimeter:
            break
        following = (narrowest + 1) % len(arcs)
        arcs[narrowest] = np.concatenate([arcs[narrowest], across[narrowest][1], arcs[following]]).astype(np.int32)
        del arcs[following]
    return arcs


def _border(
    start: FloatArray,
    end: FloatArray,
    strap: FloatArray,
    bare: FloatArray,
    distance: SurfaceDistance,
    clearance: float,
    edge: float,
) -> FloatArray:
    """Return the inner points of a strap's border from one place to another, shape (M, 3).

    It runs where photos show cloth on one side and the bare mannequin on the other, as far off as its ends are.

    Args:
        start, end: Of the garment [m], shape (3,).
        strap: Points of the mannequin that show it [m], shape (N, 3).
        bare: Points of it that photos show bare [m], shape (M, 3).
        distance: Signed distances to the mannequin [m].
        clearance: It is no nearer to it [m].
        edge: Between points of the line [m].
    """
    way = np.vstack([start, _way(start, end, strap, bare), end])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    count = max(int(np.ceil(along[-1] / edge)), 2)
    at = np.linspace(0.0, along[-1], count + 1)
    line = np.column_stack([np.interp(at, along, way[:, d]) for d in range(3)])
    off = np.maximum(distance.signed(line[[0, -1]]).distance, clearance)
    wanted = np.linspace(off[0], off[1], count + 1)[1:-1]
    outside = KeptOutside(distance, line[1:-1])
    for _ in range(int(np.ceil(2.0 * (SPACING / edge) ** 2))):  # the points' own zigzag
        line[1:-1] = outside.pushed(0.5 * line[1:-1] + 0.25 * (line[:-2] + line[2:]), wanted)
    return line[1:-1]


def _way(start: FloatArray, end: FloatArray, strap: FloatArray, bare: FloatArray) -> FloatArray:
    """Return the points on the shortest way along the border of a strap (N, 3) beside bare points (M, 3), shape (K, 3).

    Where nothing was seen beside the strap it runs over the strap, but only as far as it must.
    """
    reach = BESIDE * SPACING
    beside = cKDTree(strap).query_ball_point(bare, reach)
    middles = [0.5 * (strap[near].mean(axis=0) + place) for near, place in zip(beside, bare, strict=True) if near]
    points = np.vstack([*middles, strap]) if middles else strap
    off = np.where(np.arange(len(points)) < len(middles), 1.0, OVER_STRAP)
    tree = cKDTree(points)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    length = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1) * off[pairs].max(axis=1)
    first, last = (int(tree.query(place)[1]) for place in (start, end))
    graph = coo_matrix((length, pairs.T), (len(points), len(points)))
    before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)[1]
    places = [last]
    while places[-1] != first and before[places[-1]] >= 0:
        places.append(int(before[places[-1]]))
    return points[places[::-1]]
