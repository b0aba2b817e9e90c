"""A sewn garment in space whose triangles are as long as their panels say.

Alternates between the best rigid frame of each triangle and the positions that agree best with all frames (Liu, Zhang,
Xu, Gotsman & Gortler 2008, "A local/global approach to mesh parameterization", section 4, from the plane to space
instead of the other way round). The frames begin as the panels are placed, so that the first solution spreads the
closing of the seams over the panels. Each vertex is drawn to where its panel stands about the body, first strongly,
then ever less. Each triangle's frame is drawn to those of its neighbours (Levi & Gotsman 2015, "Smooth rotation
enhanced as-rigid-as-possible mesh animation"), or nothing would resist bending: the tip of a dart would stay pushed in.
So the garment stays open for the body, and hardly folds into itself. Over a seam that the file has folded, none is
drawn: a collar's fall stays down.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from vto_pipeline.garment.pattern.folds import folds, inside_out
from vto_pipeline.garment.pattern.sew import Sewn
from vto_pipeline.geometry.topology import laid_edge_lengths, opposite_half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_ROUNDS = 20  # at each of the holds
_HOLDS = (0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6)  # weights of staying in place against the frames
_SMOOTH = 0.03  # weight of a neighbour's frame against a triangle's own sides
_MOMENTUM = 0.9  # of the last move; plain alternation takes several times the rounds
_BULGE = 0.1  # of its reach
_LEAST_COT = 0.05  # weights stay positive where a corner is blunt


def in_shape(sewn: Sewn, job: Job, worn: bool = False) -> TriangleMesh:
    """Return a sewn mesh bent so that hardly an edge is stretched.

    Args:
        sewn: As it comes from the welding. What is where it was worn is bent as it was there, and stays.
        job: Measures what stretch is left.
        worn: Whether the panels stand where they were worn: then their middle stays where it is, and not their top.
    """
    placed = sewn.mesh.vertices
    mesh = sewn.mesh
    if not sewn.in_shape:
        mesh = replace(mesh, vertices=_as_placed(embed(mesh, sewn.frames), placed, worn))
    assert mesh.texture is not None
    stretch = laid_edge_lengths(mesh, mesh.vertices[mesh.faces]) / laid_edge_lengths(mesh, mesh.texture) - 1.0
    low, high = np.percentile(stretch, [1, 99])
    how = "sewn where it was worn" if sewn.in_shape else "sewn and bent in space"
    job.note(f"{how}; at most places edges are stretched by {low:+.1%} to {high:+.1%}")
    job.measure(stretch_p01_share=float(low), stretch_p99_share=float(high))
    return mesh


def embed(mesh: TriangleMesh, frames: FloatArray) -> FloatArray:
    """Return positions near the mesh's in which its triangles have the shape of their panels [m], shape (V, 3).

    Args:
        mesh: Its texture coordinates are the panels [m]; its positions are where these stand about the body.
        frames: Where the axes of each triangle's panel point at first, orthonormal columns, shape (F, 3, 2).
    """
    assert mesh.texture is not None
    start, end = mesh.faces, np.roll(mesh.faces, -1, axis=1)
    flat = np.roll(mesh.texture, -1, axis=1) - mesh.texture  # the sides of each face in the plane, shape (F, 3, 2)
    weight = _cotangents(mesh.texture)
    count = len(mesh.vertices)
    rows, columns = start.ravel(), end.ravel()
    links = coo_array((weight.ravel(), (rows, columns)), shape=(count, count))
    links = links + links.T
    twin, turns = _neighbours(mesh)
    area = float(np.abs(np.linalg.det(mesh.texture[:, 1:] - mesh.texture[:, :1])).mean())
    folded = folds(mesh, frames, twin)
    alike = (twin >= 0) & ~folded
    x = place = mesh.vertices + _bulge(mesh, frames, inside_out(folded, twin))
    for share in _HOLDS:
        hold = share * float(weight.mean())
        solver = splu(csc_array(_diagonal(links.sum(axis=1) + hold) - links))
        for _ in range(_ROUNDS):
            wanted = weight[:, :, None] * (flat @ np.swapaxes(frames, 1, 2))  # along each side, in space
            right = hold * place
            for k in range(3):
                right[:, k] += np.bincount(columns, wanted[:, :, k].ravel(), count)
                right[:, k] -= np.bincount(rows, wanted[:, :, k].ravel(), count)
            before, x = x, np.asarray(solver.solve(right))
            ahead = (x + _MOMENTUM * (x - before))[mesh.faces]
            beside = np.where(alike[:, None, None], frames[twin // 3] @ turns, 0.0)
            smooth = _SMOOTH * area * beside.reshape(-1, 3, 3, 2).sum(axis=1)
            frames = _frames(np.roll(ahead, -1, axis=1) - ahead, flat, weight, smooth)
    return x


def _as_placed(x: FloatArray, placed: FloatArray, worn: bool) -> FloatArray:
    """Return the positions turned and shifted to where the panels are placed, its top, which it hangs from, as high.

    Without stretch, cloth that is free to turn does: an open jacket by more than a right angle. Panels that were worn
    stand nearest to their cloth, so it is their middle that says how high it was; corners of a flat flare stand higher.
    """
    around = x - x.mean(axis=0)
    turn, _ = Rotation.align_vectors(placed - placed.mean(axis=0), around)
    found = turn.apply(around) + placed.mean(axis=0)
    if not worn:
        found[:, 1] += placed[:, 1].max() - found[:, 1].max()
    return np.asarray(found)


def _bulge(mesh: TriangleMesh, frames: FloatArray, turned: NDArray[np.bool_]) -> FloatArray:
    """Return a small way outwards for each vertex, most in the middle: flat cloth with a dart would never leave its
    plane, as both sides of it are alike."""
    normals = np.cross(frames[:, :, 0], frames[:, :, 1]) * np.where(turned, -1.0, 1.0)[:, None]
    out = np.stack([np.bincount(mesh.faces.ravel(), np.repeat(normals[:, k], 3)) for k in range(3)], axis=1)
    out = out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
    away = np.linalg.norm(mesh.vertices - mesh.vertices.mean(axis=0), axis=1)
    return np.asarray(_BULGE * (away.max() - away**2 / away.max())[:, None] * out)


def _neighbours(mesh: TriangleMesh) -> tuple[IntArray, FloatArray]:
    """Return the other half of each half-edge, (3F,), -1 for none, and what turns the axes there to these."""
    twin = opposite_half_edges(mesh)
    assert mesh.texture is not None
    here = (np.roll(mesh.texture, -1, axis=1) - mesh.texture).reshape(-1, 2)
    angle = np.arctan2(*-here[twin].T[::-1]) - np.arctan2(*here.T[::-1])
    cos, sin = np.cos(angle), np.sin(angle)
    return twin, np.stack([np.stack([cos, -sin], axis=1), np.stack([sin, cos], axis=1)], axis=1)


def _frames(sides: FloatArray, flat: FloatArray, weight: FloatArray, smooth: FloatArray) -> FloatArray:
    """Return the orthonormal frames that turn sides in the plane best into those in space, shape (F, 3, 2).

    Args:
        sides, flat: In space and in the plane, shapes (F, 3, 3) and (F, 3, 2) [m].
        weight: Of the sides, shape (F, 3).
        smooth: Sum of the neighbours' frames with their weight, shape (F, 3, 2) [m²].
    """
    u, _, v = np.linalg.svd(np.swapaxes(weight[:, :, None] * sides, 1, 2) @ flat + smooth, full_matrices=False)
    return np.asarray(u @ v)


def _cotangents(laid: FloatArray) -> FloatArray:
    """Return half the cotangent of the angle across from each side, of flat faces (F, 3, 2), shape (F, 3)."""
    to = [laid[:, (k + s) % 3] - laid[:, (k + 2) % 3] for k in range(3) for s in (0, 1)]
    cot = [(a * b).sum(axis=1) / np.abs(_cross(a, b)) for a, b in zip(to[::2], to[1::2], strict=True)]
    return 0.5 * np.maximum(np.stack(cot, axis=1), _LEAST_COT)


def _cross(a: FloatArray, b: FloatArray) -> NDArray[np.float64]:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _diagonal(values: FloatArray) -> coo_array:
    here = np.arange(len(values))
    return coo_array((values, (here, here)), shape=(len(values), len(values)))
