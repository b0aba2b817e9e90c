"""A scan that is simulated: the drape of a known pattern in other triangles, with noise, its seams drawn on it.

The other triangles come from thinning out finer ones. A remesher would round the corners of rims, which a scan has.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.garment.unsewn.cut import cut_apart, runs, seams_of_charts
from vto_pipeline.geometry.remeshing.decimate import decimate, faces_at
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_GENTLE = 3.0


def draped_truth(run: Path) -> TriangleMesh:
    """Return the garment that a run draped, its texture coordinates the panels of its pattern [m].

    Raises:
        InputError: the run draped no pattern.
    """
    draped = read_own_mesh(run / "out" / "draped.ply")
    with np.load(run / "out" / "rest_shape.npz", allow_pickle=False) as rest:
        if "panels" not in rest or len(rest["panels"]) != len(draped.faces):
            raise InputError("the run draped no sewing pattern", where=str(run))
        return replace(draped, texture=rest["panels"])


def drawn_seams(truth: TriangleMesh) -> dict[str, FloatArray]:
    """Return the true seams as lines, name -> points [m], shape (K, 3).

    Args:
        truth: Its texture coordinates are its panels.
    """
    pieces = cut_apart(truth, seams_of_charts(truth))
    found = runs(truth, pieces, [np.zeros(len(piece.start), np.bool_) for piece in pieces])
    lines: dict[str, FloatArray] = {}
    for number, run in enumerate(found):
        if run.sewn > number:
            piece = pieces[run.piece]
            at = np.arange(run.first, run.first + run.count + 1) % len(piece.start)
            lines[f"seam {len(lines)}"] = piece.mesh.vertices[piece.start[at]]
    return lines


def scanned(truth: TriangleMesh, edge: float, noise: float, seed: int) -> tuple[TriangleMesh, dict[str, FloatArray]]:
    """Return a simulated scan, and its seams as a person would draw them on it.

    Args:
        truth: The garment in space, with its panels.
        edge: Of the scan's triangles [m].
        noise: Standard deviation of its vertices, and of points on seams, in each direction [m].
        seed: Of the noise.
    """
    rng = np.random.default_rng(seed)
    import igl

    finer = TriangleMesh(*igl.upsample(truth.vertices, truth.faces.astype(np.int64), 1))
    other = decimate(finer, faces_at(finer, edge), aggressiveness=_GENTLE)
    scan = TriangleMesh(other.vertices + rng.normal(0.0, noise, other.vertices.shape), other.faces)
    return scan, {name: line + rng.normal(0.0, noise, line.shape) for name, line in drawn_seams(truth).items()}
