"""A scan of any unit, axes and orientation: metres, +Y up, facing outwards, without floor and crumbs."""

from __future__ import annotations

import numpy as np

from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import face_area_vectors, face_components, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

HEIGHT_M = (0.35, 2.30)
"""Of a form without neck and legs, and of the tallest people."""
_UNITS_M = {"metres": 1.0, "decimetres": 0.1, "centimetres": 0.01, "millimetres": 0.001}
_AXES = {
    "+Y": np.eye(3),
    "+Z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-Z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "-Y": np.diag([1.0, -1, -1]),
    "+X": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "-X": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}
"""What a scanner may call up -> the turn that makes it +Y."""
_SMALL_PIECE = 0.02
_FLAT_SHARE = 0.05
_LEVEL = 0.98
_FLOOR_BAND_M = 0.008
_SOLES_M2 = 0.08
"""More level surface than this at one height below the knee is no pair of feet [m²]."""
_LOW_SHARE = 0.25


def in_metres(scan: TriangleMesh, job: Job) -> TriangleMesh:
    """Return the scan in metres, without pieces that are flat (a floor) or small (crumbs).

    Raises:
        AvatarError: in no unit is it as large as a body or a form.
    """
    count, piece = face_components(scan)
    corners = scan.vertices[scan.faces].reshape(-1, 3)
    of = np.repeat(piece, 3)
    extent = np.zeros((count, 3))
    for axis in range(3):
        high, low = np.full(count, -np.inf), np.full(count, np.inf)
        np.maximum.at(high, of, corners[:, axis])
        np.minimum.at(low, of, corners[:, axis])
        extent[:, axis] = high - low
    good = extent.min(axis=1) > _FLAT_SHARE * extent.max(axis=1)
    area = np.bincount(piece, np.linalg.norm(face_area_vectors(scan), axis=1), count)
    good &= area > _SMALL_PIECE * area[good].max(initial=0.0)
    if not good.any():
        raise AvatarError("the scan holds no piece that could be a body: all are flat", hint="is it a scan of a floor?")
    if not good.all():
        job.note(f"{int((~good).sum())} of {count} pieces of the scan left out: crumbs or flat pieces such as a floor")
    kept = submesh(scan, good[piece])[0]
    longest = float(np.ptp(kept.vertices, axis=0).max())
    fitting = [name for name, metres in _UNITS_M.items() if HEIGHT_M[0] <= longest * metres <= HEIGHT_M[1]]
    if not fitting:
        raise AvatarError(
            f"the scan's longest side is {longest:.4g}: in no unit of {', '.join(_UNITS_M)} is that {HEIGHT_M[0]} to "
            f"{HEIGHT_M[1]} m, as a body or a dress form is",
            hint="scale it to metres; leave out what stands around the body",
        )
    if fitting[0] != "metres":
        job.note(f"the scan is taken to be in {fitting[0]}: its longest side is {longest:.4g}")
    return TriangleMesh(kept.vertices * _UNITS_M[fitting[0]], kept.faces)


def turns_upright(scan: TriangleMesh) -> dict[str, FloatArray]:
    """Return axis -> the turn that makes it +Y, shape (3, 3), for all axes along which the scan is tall enough."""
    tall = np.ptp(scan.vertices, axis=0)
    return {name: turn for name, turn in _AXES.items() if tall["XYZ".index(name[1])] > HEIGHT_M[0]}


def without_floor(scan: TriangleMesh) -> TriangleMesh:
    """Return the scan, in metres and +Y up, without a floor that has grown together with the feet."""
    area = face_area_vectors(scan)
    size = np.linalg.norm(area, axis=1)
    middle = scan.vertices[scan.faces].mean(axis=1)[:, 1]
    bottom, height = float(scan.vertices[:, 1].min()), float(np.ptp(scan.vertices[:, 1]))
    level = (np.abs(area[:, 1]) > _LEVEL * size) & (middle < bottom + _LOW_SHARE * height)
    if not level.any():
        return scan
    bins = np.floor((middle - bottom) / _FLOOR_BAND_M).astype(int)
    at = np.bincount(bins[level], size[level])
    spread = np.convolve(at, np.ones(3), mode="same")
    if spread.max() < _SOLES_M2:
        return scan
    top = bottom + (int(np.argmax(spread)) + 2) * _FLOOR_BAND_M
    kept = submesh(scan, middle > top)[0]
    count, piece = face_components(kept)
    part = np.bincount(piece, np.linalg.norm(face_area_vectors(kept), axis=1), count)
    return submesh(kept, (part > _SMALL_PIECE * part.max())[piece])[0]


def inside_out(scan: TriangleMesh) -> bool:
    """Whether the surface of what stands along +Y faces its own axis.

    By the flux of the horizontal position through it, twice the volume inside: a floor or an end left open has none of
    it, and holes have little.
    """
    area = face_area_vectors(scan)
    size = np.linalg.norm(area, axis=1)
    middle = scan.vertices[scan.faces].mean(axis=1)
    away = middle - size @ middle / size.sum()
    return bool((away * area)[:, [0, 2]].sum() < 0)
