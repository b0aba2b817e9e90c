"""Normalisation of a scan: metres, +Y up, normals outwards, without floor, small pieces and what stands apart."""

from __future__ import annotations

import numpy as np

from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.apart import APART, faces_apart
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.geometry.floor import level_band
from vto_pipeline.geometry.metres import need_metres
from vto_pipeline.geometry.topology import component_areas, face_areas, submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.volume import axis_volumes

HEIGHT_M = (0.35, 2.30)
"""Of a form without neck and legs, and of the tallest people."""
_UNITS_M = {"metres": 1.0, "decimetres": 0.1, "centimetres": 0.01, "millimetres": 0.001}
AXES = {
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
_SOLES_M2 = 0.08
"""More level surface than this at one height below the knee is no pair of feet [m²]."""
_LOW_SHARE = 0.25


def in_metres(scan: TriangleMesh, job: Job) -> TriangleMesh:
    """Return the scan in metres, without pieces that are flat (a floor) or small.

    Raises:
        AvatarError: in no unit is it as large as a body or a form.
        ScanError: its unit is unknown.
    """
    piece, area = component_areas(need_metres(scan, "fitting a body"))
    count = len(area)
    corners = scan.vertices[scan.faces].reshape(-1, 3)
    of = np.repeat(piece, 3)
    extent = np.zeros((count, 3))
    for axis in range(3):
        high, low = np.full(count, -np.inf), np.full(count, np.inf)
        np.maximum.at(high, of, corners[:, axis])
        np.minimum.at(low, of, corners[:, axis])
        extent[:, axis] = high - low
    good = extent.min(axis=1) > _FLAT_SHARE * extent.max(axis=1)
    good &= area > _SMALL_PIECE * area[good].max(initial=0.0)
    if not good.any():
        raise AvatarError("no piece of the scan could be a body: all are flat", hint="is it a scan of a floor?")
    if not good.all():
        job.note(f"{int((~good).sum())} of {count} pieces of the scan were dropped: small, or flat such as a floor")
    kept = submesh(scan, good[piece])[0]
    longest = float(np.ptp(kept.vertices, axis=0).max())
    fitting = [name for name, metres in _UNITS_M.items() if HEIGHT_M[0] <= longest * metres <= HEIGHT_M[1]]
    if not fitting:
        raise AvatarError(
            f"the scan's longest side is {longest:.4g}. A body or a dress form has {HEIGHT_M[0]} to {HEIGHT_M[1]} m; "
            f"no unit of {', '.join(_UNITS_M)} gives that",
            hint="scale it to metres; remove what stands around the body",
        )
    if fitting[0] != "metres":
        job.note(f"the scan is assumed to be in {fitting[0]}: its longest side is {longest:.4g}")
    return TriangleMesh(kept.vertices * _UNITS_M[fitting[0]], kept.faces)


def without_surroundings(scan: TriangleMesh, body: TriangleMesh, job: Job) -> TriangleMesh:
    """Return the scan without pieces that stand apart from the body, as furniture in the room does.

    Args:
        scan: In pieces [m].
        body: Fitted to it, in its frame.
        job: Notified of what is left out.
    """
    apart = faces_apart(scan, closest_points(scan.vertices, body.vertices, body.faces)[2])
    if not apart.any():
        return scan
    area = face_areas(scan)
    share = 100.0 * area[apart].sum() / area.sum()
    job.note(f"left out {share:.0f} % of the scan: pieces more than {1e3 * APART:.0f} mm beside the body")
    return submesh(scan, ~apart)[0]


def candidate_up_rotations(scan: TriangleMesh) -> dict[str, FloatArray]:
    """Return axis -> the turn that makes it +Y, shape (3, 3), for all axes along which the scan is tall enough."""
    tall = np.ptp(scan.vertices, axis=0)
    return {name: turn for name, turn in AXES.items() if tall["XYZ".index(name[1])] > HEIGHT_M[0]}


def without_floor(scan: TriangleMesh) -> TriangleMesh:
    """Return the scan, in metres and +Y up, without a floor that has grown together with the feet."""
    bottom, height = float(scan.vertices[:, 1].min()), float(np.ptp(scan.vertices[:, 1]))
    found = level_band(scan, bottom + _LOW_SHARE * height)
    if found is None or found.area < _SOLES_M2:
        return scan
    kept = submesh(scan, scan.vertices[scan.faces].mean(axis=1)[:, 1] > found.top)[0]
    piece, part = component_areas(kept)
    return submesh(kept, (part > _SMALL_PIECE * part.max())[piece])[0]


def inside_out(scan: TriangleMesh) -> bool:
    """Whether the surface of what stands along +Y faces its own axis.

    By the volume inside as its sides tell it: a floor or an end left open has no part in it, and holes have little.
    """
    volumes, _ = axis_volumes(scan.vertices, scan.faces, np.zeros(len(scan.faces), np.int32), 1)
    return bool(volumes[0, [0, 2]].sum() < 0)
