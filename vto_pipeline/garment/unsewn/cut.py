"""A surface cut along its seams: the pieces, their outlines, and which part of an outline is sewn to which."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.topology import boundary_walks, opposite_half_edges, surface_area
from vto_pipeline.model.arrays import IntArray
from vto_pipeline.model.mesh import TriangleMesh

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Piece:
    """A piece of a surface that was cut, a disc.

    Args:
        mesh: In space, with a vertex for each side of a cut.
        vertex: Of the whole, for each of its own, shape (V',).
        face: Of the whole, for each of its own, shape (F',).
        outline: Half-edges of the whole around it, in order, shape (B,).
        start: Own vertex where each of those starts, shape (B,).
    """

    mesh: TriangleMesh
    vertex: IntArray
    face: IntArray
    outline: IntArray
    start: IntArray


@dataclass(frozen=True)
class Run:
    """A part of a piece's outline between two corners.

    Args:
        piece: Number of the piece.
        first: Where in its outline the run begins.
        count: Of its half-edges.
        sewn: Number of the run that is sewn to it, which goes the other way; -1 at an opening.
    """

    piece: int
    first: int
    count: int
    sewn: int


def cut_apart(mesh: TriangleMesh, seam: Bools) -> list[Piece]:
    """Return the pieces that seams part a surface into, in the order of their first faces.

    Args:
        mesh: Manifold, oriented.
        seam: Which half-edges are on a seam; both sides of each, shape (3F,).

    Raises:
        InputError: the mesh is not manifold.
        GarmentError: a piece is a ring or a ball, so it cannot be laid flat.
    """
    opposite = opposite_half_edges(mesh)
    whole = (opposite >= 0) & ~seam
    half = np.flatnonzero(whole)
    across = opposite[half]
    corner = _linked(np.stack([half, _next(half)]), np.stack([_next(across), across]), len(seam))
    pieces = _linked(half[None] // 3, across[None] // 3, len(mesh.faces))
    names, first = np.unique(pieces, return_index=True)
    found: list[Piece] = []
    for name in names[np.argsort(first)]:
        face = np.flatnonzero(pieces == name)
        corners = corner.reshape(-1, 3)[face]
        numbers, at, flat = np.unique(corners, return_index=True, return_inverse=True)
        vertex = mesh.faces[face].ravel()[at]
        own = TriangleMesh(mesh.vertices[vertex], flat.reshape(-1, 3).astype(np.int32))
        walks = boundary_walks(own)
        euler = len(numbers) - (3 * len(face) + sum(map(len, walks))) // 2 + len(face)
        if len(walks) != 1 or euler != 1:
            raise _no_disc(own, len(walks), len(found))
        outline = (3 * face[walks[0] // 3] + walks[0] % 3).astype(np.int32)
        start = own.faces.ravel()[walks[0]]
        found.append(Piece(own, vertex.astype(np.int32), face.astype(np.int32), outline, start))
    return found


def runs(mesh: TriangleMesh, pieces: Sequence[Piece], corners: Sequence[Bools]) -> list[Run]:
    """Return the outlines of the pieces in parts, each of which is sewn to one other or to none.

    Args:
        mesh: The whole, before the cut.
        pieces: Of it.
        corners: Whether an outline turns sharply at the start of each of its half-edges, for each piece.
    """
    opposite = opposite_half_edges(mesh)
    sewn = np.full(len(opposite), -1)
    follows = np.full(len(opposite), -1)  # on an outline
    for piece in pieces:
        sewn[piece.outline] = opposite[piece.outline]
        follows[np.roll(piece.outline, 1)] = piece.outline
    begins = np.zeros(len(opposite), np.bool_)
    for piece, sharp in zip(pieces, corners, strict=True):
        before, after = sewn[np.roll(piece.outline, 1)], sewn[piece.outline]
        goes_on = np.where(after >= 0, (before >= 0) & (follows[after] == before), before < 0)
        tip = after == np.roll(piece.outline, 1)  # of a dart, whose sides are sewn to each other
        begins[piece.outline[~goes_on | sharp | tip]] = True
        both = sharp & goes_on & (after >= 0)  # a corner of one side ends the run of the other as well
        begins[before[both]] = True
    found: list[tuple[int, int, int, int]] = []
    run_of = np.full(len(opposite), -1)
    for number, piece in enumerate(pieces):
        size = len(piece.outline)
        at = np.flatnonzero(begins[piece.outline])
        at = at if len(at) else np.zeros(1, np.int64)
        for first, after_it in zip(at, np.append(at[1:], at[0] + size), strict=True):
            run_of[piece.outline[np.arange(first, after_it) % size]] = len(found)
            found.append((number, int(first), int(after_it - first), int(sewn[piece.outline[first]])))
    return [Run(piece, first, count, int(run_of[other]) if other >= 0 else -1) for piece, first, count, other in found]


def seams_of_charts(mesh: TriangleMesh) -> Bools:
    """Return which half-edges have another place in the texture on each side, shape (3F,).

    Args:
        mesh: With texture coordinates.
    """
    assert mesh.texture is not None
    opposite = opposite_half_edges(mesh)
    half = np.flatnonzero(opposite >= 0)
    place = mesh.texture.reshape(-1, 2)
    size = float(np.abs(np.diff(mesh.texture, axis=1)).max())
    apart = np.abs(place[half] - place[_next(opposite[half])]).max(axis=1)
    apart = np.maximum(apart, np.abs(place[_next(half)] - place[opposite[half]]).max(axis=1))
    seam = np.zeros(len(place), np.bool_)
    seam[half[apart > 1e-5 * size]] = True
    return seam


def _next(half: NDArray[np.integer]) -> NDArray[np.integer]:
    return np.asarray(3 * (half // 3) + (half + 1) % 3)


def _linked(one: NDArray[np.integer], other: NDArray[np.integer], count: int) -> NDArray[np.integer]:
    graph = coo_array((np.ones(one.size, np.int8), (one.ravel(), other.ravel())), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _no_disc(mesh: TriangleMesh, openings: int, number: int) -> GarmentError:
    middle, area = mesh.vertices.mean(axis=0), surface_area(mesh)
    x, y, z = middle
    place = f"piece {number} around ({x:.2f}, {y:.2f}, {z:.2f}) m, {1e4 * area:.0f} cm²"
    problem = f"{place}, has {openings} rims, where a piece that can be laid flat has one"
    return GarmentError(problem, hint="a seam from rim to rim is missing there: draw it in --seams")
