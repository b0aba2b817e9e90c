"""Clean edges for the openings of a scanned garment: no ledges to the body, no flaps, no zigzag."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.garment.subtraction.pieces import large_faces, without_crumbs
from vto_pipeline.geometry.geodesic import distance_from
from vto_pipeline.geometry.laplace import extend_smoothly
from vto_pipeline.geometry.remeshing.clip import clip_to_positive
from vto_pipeline.geometry.remeshing.rims import perimeter
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import (
    boundary_loops,
    edge_faces,
    edges,
    face_components,
    face_normals,
    submesh,
)
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

LEDGE_COSINE = 0.45
"""A face near a rim that is steeper to the mannequin than this bridges the gap from cloth to body."""
ROUNDS = 4
"""A rim is smoothed so often, for the arc length of a zigzag overstates the curve's and each round measures it anew."""
BAND = 4.0
"""Fairing a rim moves the surface within this many times the largest displacement."""


def trim_ledges(shell: TriangleMesh, mannequin: TriangleMesh, widest: float) -> TriangleMesh:
    """Return the shell without the faces that lead from a rim down to the mannequin.

    A fused scan closes the gap under a hem or in a collar by a ledge. It is connected to the rim, stands across
    the mannequin's surface, and is no wider than the gap. Cloth that hangs beyond the mannequin has none.

    Args:
        shell: The cut-out garment.
        mannequin: What it was on.
        widest: The widest ledge looked for [m].
    """
    loops = boundary_loops(shell)
    if not loops:
        return shell
    middle = shell.vertices[shell.faces].mean(axis=1)
    nearest = SurfaceDistance(mannequin).nearest(middle)
    facing = np.einsum("fd,fd->f", face_normals(shell), face_normals(mannequin)[nearest.face])
    rim = np.concatenate(loops)
    to_rim, _ = cKDTree(shell.vertices[rim]).query(middle, distance_upper_bound=widest)
    steep = (facing < LEDGE_COSINE) & np.isfinite(to_rim) & (nearest.distance < widest)
    on_rim = np.zeros(len(shell.vertices), dtype=bool)
    on_rim[rim] = True
    ledge = reached(shell, steep, steep & (on_rim[shell.faces].sum(axis=1) >= 2))
    return without_crumbs(submesh(shell, ~ledge)[0]) if ledge.any() else shell


def drop_flaps(
    shell: TriangleMesh, width: float, shortest: float, is_opening: Callable[[FloatArray], bool] | None = None
) -> TriangleMesh:
    """Return the shell without what hangs on it by less than a width: erode by half of it, keep the large parts of
    each piece, grow back.

    Cloth between small holes hangs on nothing: they will be filled, and much of a patchy scan is such cloth. A strap is
    as narrow, but parts two openings: it stays.

    Args:
        shell: The cut-out garment.
        width: [m]; with none, nothing is dropped.
        shortest: Shorter loops are holes of the scan [m].
        is_opening: Tells of a loop (L, 3) whether it is an opening of the garment; None where nothing tells.
    """
    loops = [loop for loop in boundary_loops(shell) if perimeter(shell, loop) >= shortest]
    if not loops or width == 0.0:
        return shell
    radius = 0.5 * width
    depth = distance_from(shell, np.concatenate(loops), 4.0 * radius)
    inside = np.isfinite(depth) & (depth <= radius)
    kept_faces = ~np.any(inside[shell.faces], axis=1)
    if not kept_faces.any():
        return shell
    core, source = submesh(shell, kept_faces)
    seeds = source[np.unique(core.faces[large_faces(core, face_components(shell)[1][kept_faces])])]
    reach = distance_from(shell, seeds.astype(np.int32), 8.0 * radius)
    kept = 1.5 * radius - np.minimum(reach, 8.0 * radius)
    if is_opening is not None:
        openings = [loop for loop in loops if is_opening(shell.vertices[loop])]
        kept[_parting(shell, kept < 0.0, openings)] = radius
    return without_crumbs(clip_to_positive(shell, kept))


def _parting(shell: TriangleMesh, among: NDArray[np.bool_], loops: Sequence[IntArray]) -> NDArray[np.bool_]:
    """Return which vertices of a set belong to patches of it that lie between two of some loops or more, shape (V,)."""
    pair = edges(shell)
    pair = pair[among[pair].all(axis=1)]
    graph = coo_matrix((np.ones(len(pair), np.int8), pair.T), (len(among),) * 2)
    count, patch = connected_components(graph, directed=False)
    beside = np.zeros(count, dtype=int)
    for loop in loops:
        beside[np.unique(patch[loop])] += 1
    return np.asarray(among & (beside >= 2)[patch])


def fair_rims(shell: TriangleMesh, wavelength: float) -> TriangleMesh:
    """Return the shell with zigzag shorter than a wavelength [m] taken out of its boundary loops.

    Each loop is smoothed as a curve by its arc length; the surface nearby follows by a harmonic displacement.
    """
    loops = boundary_loops(shell)
    if not loops:
        return shell
    target = shell.vertices.copy()
    for loop in loops:
        for _ in range(ROUNDS):
            target[loop] = smooth_curve(target[loop], wavelength)
    rim = np.concatenate(loops)
    largest = float(np.linalg.norm(target - shell.vertices, axis=1).max())
    near = np.isfinite(distance_from(shell, rim, max(BAND * largest, 1e-9)))
    free = near.copy()
    free[rim] = False
    band, source = submesh(shell, np.any(near[shell.faces], axis=1))
    moved = shell.vertices.copy()
    moved[source] += extend_smoothly(band, (target - shell.vertices)[source], free[source], order=1)
    return TriangleMesh(moved, shell.faces, shell.colors)


def smooth_curve(points: FloatArray, wavelength: float) -> FloatArray:
    """Return a closed curve without its waves shorter than `wavelength` [m]; no point moves along it.

    A Gaussian low-pass over arc length; the shrinking it brings is taken back by filtering what it removed once more.
    """
    count = len(points)
    closed = np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    even = np.arange(count + 1) / count * along[-1]
    curve = np.column_stack([np.interp(even[:-1], along, closed[:, d]) for d in range(3)])
    frequency = np.fft.rfftfreq(count, along[-1] / count)
    gain = np.exp(-0.5 * np.square(frequency * wavelength))
    gain = gain * (2.0 - gain)
    move = np.fft.irfft(np.fft.rfft(curve, axis=0) * gain[:, None], count, axis=0) - curve
    move = np.vstack([move, move[:1]])
    return points + np.column_stack([np.interp(along[:-1], even, move[:, d]) for d in range(3)])


def reached(mesh: TriangleMesh, among: NDArray[np.bool_], seeds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the faces connected to a seed through edges between faces of the set, shape (F,)."""
    beside = edge_faces(mesh)
    beside = beside[beside[:, 1] >= 0]
    beside = beside[among[beside].all(axis=1)]
    count = len(mesh.faces)
    graph = coo_matrix((np.ones(len(beside), np.int8), (beside[:, 0], beside[:, 1])), (count, count))
    pieces, piece = connected_components(graph, directed=False)
    return np.bincount(piece, seeds, pieces)[piece] > 0
