"""Which way a garment comes apart: along the panels its file has, along lines that were drawn, or where its type has
seams."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.garment.sizes.rules import guess_rules
from vto_pipeline.garment.unsewn.cut import seams_of_charts
from vto_pipeline.garment.unsewn.find import find_seams
from vto_pipeline.garment.unsewn.noise import noise_of, without_noise
from vto_pipeline.garment.unsewn.rims import rims_of
from vto_pipeline.garment.unsewn.trace import trace
from vto_pipeline.garment.unsewn.unsew import Unsewn, unsew
from vto_pipeline.geometry.remeshing.repair import RepairConfig, is_manifold, is_oriented, repair
from vto_pipeline.geometry.topology import boundary_loops, face_areas
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import LENGTH_M

Seams = Literal["auto", "charts"] | Mapping[str, FloatArray]
"""Where to cut: charts of the texture, lines by name (K, 3) [m], or whatever is there."""

_TRUE = 0.1  # by which the median face may be larger or smaller than in the texture
_MOST_M = 1e-3  # more is no noise of a scanner but folds that the mesh is too coarse for
_SAME_M = 1e-6


def recover(mesh: TriangleMesh, seams: Seams, fabric: Fabric, name: str, job: Job) -> Unsewn:
    """Return the sewing pattern of a garment in space.

    Args:
        mesh: The garment alone, in metres, worn upright: +Y up, +Z the front. Its holes are its openings.
        seams: Where to cut. With "auto", charts are taken if they are panels at true scale, else the type's seams.
        fabric: Which stretch is taken first.
        name: Of the pattern; the type of the garment is added where the name does not say it.
        job: Receives what was taken for what.

    Raises:
        InputError: charts are wanted, and there are none.
        GarmentError: a piece is no disc, a line leaves the garment, or its openings tell no type.
    """
    job.progress(0.0, "looking for seams")
    had_charts = mesh.texture is not None
    mesh = _sound(mesh, job)
    laid = None if mesh.texture is None else _true_to_scale(mesh)
    up = np.broadcast_to([0.0, 1.0, 0.0], mesh.faces.shape)
    rims = rims_of(mesh)
    if seams == "charts" or (seams == "auto" and laid is not None):
        if mesh.texture is None:
            problem = "edges of more than two faces had to be repaired, which took the charts" if had_charts else ""
            raise InputError(problem or "the garment has no texture coordinates, so no charts to cut along")
        job.note("seams: the borders of its charts" + (", which are panels at true scale" if laid is not None else ""))
        warp = up if laid is None else _warp(mesh, laid)
        each = np.arange(3 * len(mesh.faces), dtype=np.int32)  # which edges make one line is not known
        found = unsew(mesh, np.where(seams_of_charts(mesh), each, np.int32(-1)), warp, fabric, rims, 0.0, name, job)
    else:
        if seams == "auto" and rims is None:
            count = len(boundary_loops(mesh))
            problem = f"no seams are given, and its {count} openings tell no type of garment"
            hint = "level ones tell it: 2 of a skirt, 3 of trousers, 4 of a top; else draw the seams: --seams FILE"
            raise GarmentError(problem, hint=hint)
        noise = min(noise_of(mesh), _MOST_M)
        job.note(f"noise of the surface: {1e3 * noise:.2f} mm, smoothed away")
        job.measure(noise_mm=1e3 * noise)
        smooth = without_noise(mesh, noise)
        if isinstance(seams, Mapping):
            lines: Mapping[str, FloatArray] = seams
            job.note(f"seams: {len(lines)} lines as drawn")
        else:
            assert rims is not None
            lines = find_seams(smooth, rims)
            job.note(f"seams: {', '.join(lines)}, as usual in a garment of this type; it need not have been sewn there")
        cut, seam = trace(smooth, list(lines.values()), list(lines))
        found = unsew(cut, seam, up, fabric, rims, noise, name, job)
    try:
        guess_rules(found.pattern)
    except GarmentError:
        if rims is not None:
            return replace(found, pattern=replace(found.pattern, name=f"{name} {rims.kind}"))
    return found


def _sound(mesh: TriangleMesh, job: Job) -> TriangleMesh:
    """Return the mesh with one vertex at each place, as files with charts often have several, or else repaired."""
    places, number = np.unique(np.round(mesh.vertices / _SAME_M), axis=0, return_inverse=True)
    if len(places) < len(mesh.vertices):
        vertices = np.zeros((len(places), 3))
        vertices[number.ravel()] = mesh.vertices
        faces = number.ravel()[mesh.faces].astype(np.int32)
        whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        texture = None if mesh.texture is None else mesh.texture[whole]
        welded = TriangleMesh(vertices, faces[whole], texture=texture)
        if is_manifold(welded) and is_oriented(welded):
            return welded
    if is_manifold(mesh) and is_oriented(mesh):
        return mesh
    if mesh.texture is not None:
        job.note("the surface had to be repaired, and lost its charts by that")
    return repair(mesh, RepairConfig(), job)


def _true_to_scale(mesh: TriangleMesh) -> FloatArray | None:
    """Return the texture coordinates in metres, shape (F, 3, 2), if in some unit they are as large as the cloth."""
    assert mesh.texture is not None
    area = face_areas(mesh)
    flat = 0.5 * np.abs(np.linalg.det(mesh.texture[:, 1:] - mesh.texture[:, :1]))
    if not (flat > 0.0).all():
        return None
    middle = float(np.quantile(np.sqrt(area / flat), 0.5, weights=area, method="inverted_cdf"))
    unit = min(LENGTH_M.values(), key=lambda scale: abs(np.log(middle / scale)))
    return unit * mesh.texture if abs(middle / unit - 1.0) < _TRUE else None


def _warp(mesh: TriangleMesh, laid: FloatArray) -> FloatArray:
    """Return which way v runs in each face, shape (F, 3)."""
    corners = mesh.vertices[mesh.faces]
    in_space, in_plane = (np.swapaxes(x[:, 1:] - x[:, :1], 1, 2) for x in (corners, laid))
    return np.asarray((in_space @ np.linalg.inv(in_plane))[:, :, 1])
