"""A pattern that was found against the true panels of the same garment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.garment.unsewn.cut import Piece, Run, cut_apart, runs, seams_of_charts
from vto_pipeline.garment.unsewn.unsew import Unsewn
from vto_pipeline.geometry.closest import barycentric, closest_points
from vto_pipeline.geometry.topology import face_areas
from vto_pipeline.io.patterns.loops import edges_area, edges_points
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.pattern import Panel

_STEP_M = 1e-3
_ROUNDS = 30


@dataclass(frozen=True)
class PanelErrors:
    """What is wrong with a panel.

    Args:
        name: As it was found.
        true_area: [m²].
        area: Relative error of the panel's area.
        worn: Relative error of the area in space, without any flattening: how much the cloth is stretched as worn.
        outline_mean, outline_most: Distance of the outlines, either way, after a rigid fit [m].
        seams: Error of the length of each sewn part of the outline [m], shape (S,).
        worn_seams: The same of its length in space, without any flattening [m], shape (S,).
    """

    name: str
    true_area: float
    area: float
    worn: float
    outline_mean: float
    outline_most: float
    seams: FloatArray
    worn_seams: FloatArray


def compare(found: Unsewn, truth: TriangleMesh) -> list[PanelErrors]:
    """Return the errors of all panels.

    Args:
        found: The garment taken apart.
        truth: The same garment in the same place, its texture coordinates the true panels [m].
    """
    assert truth.texture is not None
    assert found.mesh.texture is not None
    pieces = cut_apart(truth, seams_of_charts(truth))
    parts = runs(truth, pieces, [np.zeros(len(piece.start), np.bool_) for piece in pieces])
    area = face_areas(truth)
    owner = np.empty(len(truth.faces), np.int64)
    for number, piece in enumerate(pieces):
        owner[piece.face] = number
    errors = []
    for panel, own in zip(found.pattern.panels, _panel_faces(found), strict=True):
        middles = found.mesh.vertices[found.mesh.faces[own]].mean(axis=1)
        face, place, _ = closest_points(middles, truth.vertices, truth.faces)
        number = int(np.bincount(owner[face]).argmax())
        piece = pieces[number]
        flat = np.zeros((len(piece.mesh.vertices), 2))
        flat[piece.mesh.faces.ravel()] = truth.texture[piece.face].reshape(-1, 2)
        inside = owner[face] == number
        shares = barycentric(place[inside], truth.vertices[truth.faces[face[inside]]])
        there = np.einsum("nk,nkd->nd", shares, truth.texture[face[inside]])
        here = found.mesh.texture[own].mean(axis=1)[inside]
        errors.append(
            _panel_errors(panel, piece, flat, [run for run in parts if run.piece == number], here, there, area)
        )
    return errors


def _panel_faces(found: Unsewn) -> list[IntArray]:
    assert found.mesh.texture is not None
    pieces = cut_apart(found.mesh, seams_of_charts(found.mesh))
    return [piece.face for piece in pieces]


def _panel_errors(
    panel: Panel,
    piece: Piece,
    flat: FloatArray,
    sewn: Sequence[Run],
    here: FloatArray,
    there: FloatArray,
    area: FloatArray,
) -> PanelErrors:
    starts = np.stack([edge.points[0] for edge in panel.edges])
    near = cKDTree(here).query(starts)[1]
    turn, shift = _rigid(here, there)
    ends = there[near] + (starts - here[near]) @ turn.T  # where on the true panel an edge starts, by the cloth there
    corners = flat[piece.mesh.faces]
    true_area = 0.5 * float(np.linalg.det(corners[:, 1:] - corners[:, :1]).sum())
    outline = edges_points(panel.edges, 1e-4)
    true_outline = flat[np.append(piece.start, piece.start[0])]
    ours, theirs = _dense(outline), _dense(true_outline)
    tree = cKDTree(theirs)
    for _ in range(_ROUNDS):
        turn, shift = _rigid(ours, theirs[tree.query(ours @ turn.T + shift)[1]])
    moved = ours @ turn.T + shift
    off = np.concatenate([tree.query(moved)[0], cKDTree(moved).query(theirs)[0]])
    lengths = np.array([np.linalg.norm(np.diff(e.points, axis=0), axis=1).sum() for e in panel.edges])
    seams, worn = [], []
    for run in sewn:
        if run.sewn >= 0:
            at = piece.start[np.arange(run.first, run.first + run.count + 1) % len(piece.start)]
            way = flat[at]
            true_length, in_space = (
                float(np.linalg.norm(np.diff(x[at], axis=0), axis=1).sum()) for x in (flat, piece.mesh.vertices)
            )
            worn.append(in_space - true_length)
            first, last = (int(np.linalg.norm(ends - way[k], axis=1).argmin()) for k in (0, -1))
            between = np.arange(first, last if last > first else last + len(ends)) % len(ends)
            length = float(lengths[between].sum())
            seams.append((0.0 if first == last and length > 2.0 * true_length else length) - true_length)
    return PanelErrors(
        panel.name,
        true_area,
        edges_area(panel.edges) / true_area - 1.0,
        float(area[piece.face].sum()) / true_area - 1.0,
        float(off.mean()),
        float(off.max()),
        np.asarray(seams),
        np.asarray(worn),
    )


def _rigid(here: FloatArray, there: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the turn and shift that take points nearest to others, no mirror."""
    a, b = here - here.mean(axis=0), there - there.mean(axis=0)
    u, _, v = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1.0, np.linalg.det(u @ v)]) @ v
    return turn, there.mean(axis=0) - turn @ here.mean(axis=0)


def _dense(points: FloatArray) -> FloatArray:
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    places = np.arange(0.0, at[-1], _STEP_M)
    return np.stack([np.interp(places, at, points[:, k]) for k in range(2)], axis=1)
