"""Fill holes so that the filling continues the slope and curvature around it.

Liepa 2003, "Filling holes in meshes": triangulate, refine to the density of the rim, fair. A rim much finer than the
mesh is refined to half the mesh's density. The fairing solves the biharmonic equation on the filling with the rings of
faces around it held; once more with the lengths and angles that the filling then has, for those before were of its flat
triangulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.laplace import extend_smoothly
from vto_pipeline.geometry.remeshing.refine import refine
from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.triangulate import triangulate_loop
from vto_pipeline.geometry.topology import edges, face_normals, half_edges, submesh, surface_area
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

RINGS = 3
"""Rings of faces around a hole that give the filling its slope and curvature."""
FAIRINGS = 2
"""The second takes 40 % of the error over a cap of a sphere away, a third 3 %."""
MOST_FACES = 100_000
"""A hole of more triangles of its rim's edge length is filled with longer edges inside."""
FINEST = 0.5
"""Edges inside are no shorter than this share of the mesh's median: thinning leaves rims as fine as they were."""


@dataclass(frozen=True)
class Rim:
    """The boundary that a filling is joined to.

    Args:
        loop: Vertices in the order of the filling, that is against the boundary, shape (L,).
        normals: Unit normal of the face beyond the edge from vertex i to i + 1, zero where there is none, shape (L, 3).
    """

    loop: IntArray
    normals: FloatArray


def fill_holes(mesh: TriangleMesh, walks: list[IntArray]) -> TriangleMesh:
    """Return the mesh with some of its boundary loops filled; old vertices and faces keep their indices.

    Args:
        mesh: A manifold mesh; colours go on smoothly too.
        walks: Of its `boundary_walks`, those to fill.

    Raises:
        GarmentError: no filling leaves the mesh manifold.
    """
    if not walks:
        return mesh
    start, normals = half_edges(mesh)[:, 0], face_normals(mesh)
    rims = [Rim(np.roll(start[walk], -1)[::-1], normals[walk[::-1] // 3]) for walk in walks]
    return _fair(_sew_in(mesh, rims), mesh)


def fill_notch(mesh: TriangleMesh, notch: IntArray, closing_line: FloatArray) -> TriangleMesh:
    """Return the mesh with a notch of its boundary filled up to a line across it.

    Args:
        mesh: A manifold mesh; the line takes the colours of its ends.
        notch: Consecutive half-edges of one of its `boundary_walks`.
        closing_line: Its inner points, from the start of the notch to its end [m], shape (M, 3).

    Raises:
        GarmentError: no filling leaves the mesh manifold.
    """
    return fill_between(mesh, [notch], [closing_line])


def fill_between(mesh: TriangleMesh, arcs: Sequence[IntArray], lines: Sequence[FloatArray]) -> TriangleMesh:
    """Return the mesh with what lies between arcs of one of its rims filled: the rim becomes as many as there are arcs.

    Args:
        mesh: A manifold mesh; the lines take the colours of their ends.
        arcs: Consecutive half-edges of one of its `boundary_walks` each, in the order of that walk.
        lines: The inner points from the start of each arc to the end of the one before it [m], shape (M, 3) each.

    Raises:
        GarmentError: no filling leaves the mesh manifold.
    """
    halves, normals = half_edges(mesh), face_normals(mesh)
    count, points, ends, loop, beyond = len(mesh.vertices), [mesh.vertices], [], [], []
    for number in reversed(range(len(arcs))):
        arc, line, before = arcs[number], lines[number], arcs[number - 1]
        new = count + np.arange(len(line))
        loop += [[halves[arc[-1], 1]], halves[arc[::-1], 0], new]
        beyond += [normals[arc[::-1] // 3], np.zeros((len(line) + 1, 3))]
        ends.append(np.where(np.arange(len(line)) < len(line) / 2, halves[arc[0], 0], halves[before[-1], 1]))
        points.append(line)
        count += len(line)
    colors = None if mesh.colors is None else np.vstack([mesh.colors, *(mesh.colors[end] for end in ends)])
    widened = TriangleMesh(np.vstack(points), mesh.faces, colors)
    rim = Rim(np.concatenate(loop).astype(np.int32), np.vstack(beyond))
    return _fair(_sew_in(widened, [rim]), widened)


def _sew_in(mesh: TriangleMesh, rims: list[Rim]) -> TriangleMesh:
    """Return mesh and flat fillings as one, the fillings' vertices and faces last."""
    rim_edges = _edges_among(mesh, np.concatenate([rim.loop for rim in rims]))
    vertices, faces, count = [mesh.vertices], [mesh.faces], len(mesh.vertices)
    finest = FINEST * float(np.median(edge_lengths(mesh)))
    for rim in rims:
        points = mesh.vertices[rim.loop]
        taken = _taken_chords(rim.loop, rim_edges)
        patch = TriangleMesh(points, triangulate_loop(points, rim.normals, taken))
        patch = refine(patch, max(_edge_inside(patch), finest), taken)
        new = patch.vertices[len(points) :]
        faces.append(np.concatenate([rim.loop, count + np.arange(len(new))]).astype(np.int32)[patch.faces])
        vertices.append(new)
        count += len(new)
    joined = TriangleMesh(np.vstack(vertices), np.vstack(faces))
    if not is_manifold(joined, np.unique(joined.faces[len(mesh.faces) :])):
        raise GarmentError(f"filling {len(rims)} holes left the mesh non-manifold", hint="clean the rims first")
    return joined


def _edge_inside(patch: TriangleMesh) -> float:
    """Return the edge length wanted in a patch [m]: its rim's, or what makes no more than so many triangles."""
    rim = np.linalg.norm(patch.vertices - np.roll(patch.vertices, -1, axis=0), axis=1)
    area = surface_area(patch)
    return float(max(rim.mean(), np.sqrt(area / MOST_FACES * 4.0 / np.sqrt(3.0))))


def _edges_among(mesh: TriangleMesh, vertices: IntArray) -> IntArray:
    """Return the edges with both ends in a set of vertices."""
    member = np.zeros(len(mesh.vertices), dtype=bool)
    member[vertices] = True
    pair = edges(mesh)
    return pair[member[pair].all(axis=1)]


def _taken_chords(loop: IntArray, pair: IntArray) -> NDArray[np.bool_]:
    """Return which places of a loop are already joined by an edge of the mesh, shape (L, L)."""
    order = np.argsort(loop)
    at = np.minimum(np.searchsorted(loop[order], pair), len(loop) - 1)
    ours = (loop[order][at] == pair).all(axis=1)
    i, j = order[at[ours]].T
    taken = np.zeros((len(loop), len(loop)), dtype=bool)
    taken[i, j] = taken[j, i] = True
    return taken


def _fair(joined: TriangleMesh, mesh: TriangleMesh) -> TriangleMesh:
    """Move the new vertices onto the biharmonic surface through the rings around them; colours go on as smoothly."""
    is_new = np.arange(len(joined.vertices)) >= len(mesh.vertices)
    near = np.zeros(len(joined.vertices), dtype=bool)
    near[joined.faces[len(mesh.faces) :]] = True
    for _ in range(RINGS):
        near[joined.faces[near[joined.faces].any(axis=1)]] = True
    around, source = submesh(joined, np.all(near[joined.faces], axis=1))
    known = mesh.vertices if mesh.colors is None else np.hstack([mesh.vertices, mesh.colors])
    values = np.vstack([known, np.zeros((int(is_new.sum()), known.shape[1]))])
    for _ in range(FAIRINGS):
        values[source] = extend_smoothly(around, values[source], is_new[source], order=2)
        around = TriangleMesh(values[source, :3], around.faces)
    colors = None if mesh.colors is None else np.clip(np.rint(values[:, 3:]), 0, 255).astype(np.uint8)
    return TriangleMesh(values[:, :3], joined.faces, colors)
