"""Edges of cloth where it ends, and not where the slope ends that a scan draws from there down to the mannequin.

Voxels and pixels are as wide as that slope: where cloth stands off, it falls to the mannequin within a few edges of the
scan. Its colours are mixed of both. A cuff that is drawn in falls as well, but has the colours of cloth. So where they
hardly differ from the mannequin's, nothing is cut.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.subtraction.cloth_edges import FARTHER, LEAST_READ, SHARP, STATION
from vto_pipeline.garment.subtraction.pieces import without_crumbs
from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.remeshing.clip import clip_to_positive
from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.smooth import smooth_values
from vto_pipeline.geometry.topology import boundary_loops, edges, face_areas, face_normals, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

SMOOTHED = 4
"""Rounds in which noise is taken out of distances and colours."""
STANDS_OFF = 2.5
"""Cloth stands off where it is so many times as far from the mannequin as distance needs to tell them apart."""
FALLEN, WIDEST = 0.9, 2.8
"""From this share of the cloth's distance farther in to where it is not told from the mannequin, an edge falls within
so many edges of the scan, seen from above."""
WINDOW = 2
"""So many stretches to both sides are looked at together, for one alone is noise."""
TOLD, MIXED = 80.0, 0.35
"""Cloth and mannequin differ by so much in colour (RGB, Euclidean) where it tells: light makes half of that. What is
cut away has a larger share of the mannequin's colour than this."""
JUST_KEPT = 0.05
"""Beside what is cut away, the rest counts as so far beyond the cut at least, so that the cut is smooth."""


def trim_falls(shell: TriangleMesh, mannequin: TriangleMesh, bare: BareParts) -> TriangleMesh:
    """Return the shell without the slopes at its rims that lead from an edge of cloth down to the mannequin.

    Args:
        shell: The cut-out garment.
        mannequin: What it was on.
        bare: What was scanned of the bare mannequin.
    """
    loops = boundary_loops(shell)
    if not loops or shell.colors is None:
        return shell
    rim, station = np.concatenate(loops), _stations(shell, loops)
    edge = float(np.median(edge_lengths(shell)))
    away = distance_from(shell, rim, FARTHER[1] * edge)
    used = np.flatnonzero(np.isfinite(away))
    at = np.zeros(len(away), dtype=int)
    at[used] = station[cKDTree(shell.vertices[rim]).query(shell.vertices[used])[1]]
    near = SurfaceDistance(mannequin).signed(shell.vertices)
    off = smooth_values(shell, near.distance, SMOOTHED)
    inner = np.isfinite(away) & (away >= FARTHER[0] * edge)
    slope = np.isfinite(away) & ~inner
    count = int(station.max()) + 1
    whole = _medians(off[:, None], at, inner, count)[:, 0]
    share = off / np.maximum(whole[at], 1e-9)
    area = np.zeros(len(away))
    np.add.at(area, shell.faces.reshape(-1), np.repeat(face_areas(shell) / 3.0, 3))
    area *= np.abs(np.einsum("vd,vd->v", vertex_normals(shell), face_normals(mannequin)[near.face]))  # seen from above
    falls = slope & (off > bare.hardly_off) & (share < FALLEN)
    wide = np.bincount(at[falls], area[falls], count) / STATION
    beside = _beside(station, loops)
    known = np.isfinite(whole[beside])
    whole = np.sum(whole[beside], axis=1, where=known) / np.maximum(known.sum(axis=1), 1)
    share = off / np.maximum(whole[at], 1e-9)
    sharp = (whole > STANDS_OFF * bare.hardly_off) & (wide[beside].mean(axis=1) < WIDEST * edge)
    beyond = np.maximum(share - SHARP, MIXED - _mixed(shell, rim, station, at, inner, bare))
    cut = slope & sharp[at] & (beyond < 0.0)
    cut &= _connected(shell, cut, rim)
    if not cut.any():
        return shell
    return without_crumbs(clip_to_positive(shell, np.where(cut, beyond, np.maximum(beyond, JUST_KEPT))))


def _stations(shell: TriangleMesh, loops: list[NDArray[np.int32]]) -> NDArray[np.int_]:
    """Return the number of the stretch of a rim that each vertex of all loops belongs to."""
    found, first = [], 0
    for loop in loops:
        rim = shell.vertices[loop]
        length = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
        count = max(round(float(length.sum()) / STATION), 1)
        found.append(first + np.minimum(np.cumsum(length) / length.sum() * count, count - 0.5).astype(int))
        first += count
    return np.concatenate(found)


def _beside(station: NDArray[np.int_], loops: list[NDArray[np.int32]]) -> NDArray[np.int_]:
    """Return the stretches next to each and itself, round its loop, shape (count, 2 WINDOW + 1)."""
    ends = np.cumsum([len(loop) for loop in loops])
    found, first = [], 0
    for end in ends:
        last = int(station[end - 1]) + 1
        around = np.arange(last - first)[:, None] + np.arange(-WINDOW, WINDOW + 1)
        found.append(first + around % (last - first))
        first = last
    return np.concatenate(found)


def _medians(values: FloatArray, at: NDArray[np.int_], among: NDArray[np.bool_], count: int) -> FloatArray:
    """Return the medians of values (V, D) at each stretch, shape (count, D); NaN where too few vertices are."""
    found = np.full((count, values.shape[1]), np.nan)
    which = np.flatnonzero(among)
    which = which[np.argsort(at[which], kind="stable")]
    parts = np.split(which, np.searchsorted(at[which], np.arange(1, count)))
    for number, part in enumerate(parts):
        if len(part) >= LEAST_READ:
            found[number] = np.median(values[part], axis=0)
    return found


def _mixed(
    shell: TriangleMesh,
    rim: NDArray[np.int32],
    station: NDArray[np.int_],
    at: NDArray[np.int_],
    inner: NDArray[np.bool_],
    bare: BareParts,
) -> FloatArray:
    """Return how far the colour of each vertex is from the cloth's to the mannequin's, both near by, (V,); 0 where
    they hardly differ."""
    colors = smooth_values(shell, np.asarray(shell.colors, dtype=float), SMOOTHED)
    count = int(station.max()) + 1
    cloth = _medians(colors, at, inner, count)
    order = np.argsort(station, kind="stable")
    first = np.minimum(np.searchsorted(station[order], np.arange(count)), len(rim) - 1)
    middle = shell.vertices[rim[order[first]]]
    way = bare.colors_near(middle) - cloth
    square = np.sum(way**2, axis=1)
    told = square > TOLD**2  # false for NaN
    mixed = np.zeros(len(at))
    mine = told[at]
    mixed[mine] = np.einsum("vd,vd->v", colors[mine] - cloth[at[mine]], way[at[mine]]) / square[at[mine]]
    return mixed


def _connected(shell: TriangleMesh, among: NDArray[np.bool_], rim: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return which vertices of a set are connected with the rim within it, shape (V,)."""
    pair = edges(shell)
    pair = pair[among[pair].all(axis=1)]
    graph = coo_matrix((np.ones(len(pair), np.int8), pair.T), (len(among),) * 2)
    count, piece = connected_components(graph, directed=False)
    return np.asarray(np.bincount(piece[rim], minlength=count)[piece] > 0)
