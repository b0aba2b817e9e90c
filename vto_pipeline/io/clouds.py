"""Point clouds from foreign files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.files import check_file
from vto_pipeline.io.formats.clean_up import check_sound
from vto_pipeline.io.formats.e57 import parse_e57
from vto_pipeline.io.formats.las import parse_las
from vto_pipeline.io.formats.pcd import parse_pcd
from vto_pipeline.io.formats.ply import parse_ply
from vto_pipeline.io.formats.pts import parse_pts
from vto_pipeline.io.formats.xyz import parse_xyz
from vto_pipeline.io.lengths import near_origin, to_metres
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud

PARSERS: dict[str, Callable[[str], Arrays]] = {
    ".ply": parse_ply,
    ".xyz": parse_xyz,
    ".txt": parse_xyz,
    ".pcd": parse_pcd,
    ".pts": parse_pts,
    ".las": parse_las,
    ".laz": parse_las,
    ".e57": parse_e57,
}
"""Suffix -> parser."""

_LIMIT_BYTES = 2_000_000_000


def read_cloud(path: Path, *, unit: str | None = None, job: Job | None = None) -> PointCloud:
    """Read a foreign cloud: parsed in a limited child process, checked, scaled to metres.

    Args:
        path: PLY, XYZ, PCD, PTS, LAS, LAZ or E57.
        unit: Unit of length in the file, a key of `units.LENGTH_M`; None: the format's, else guessed from the size.
        job: Notified of the guessed unit and of every change.

    Returns:
        The cloud [m]; the axes are the file's, moved by whole kilometres where it lies far out; normals of unit length,
        or None where the file has none that are usable.

    Raises:
        InputError: no such file, or no unit fits; FormatError: the file breaks its format.
    """
    path = check_file(Path(path), PARSERS, _LIMIT_BYTES)
    arrays = run_limited(PARSERS[path.suffix.lower()], str(path.resolve()), where=str(path))
    notes = [str(note) for note in arrays.pop("notes", np.empty(0))]
    if not len(arrays["vertices"]):
        raise FormatError("there are no points", where=str(path))
    if len(arrays.pop("faces", ())):
        notes.append("ignored the faces, as a cloud was expected")
    check_sound(arrays, path)
    normals = arrays.get("normals")
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        usable = bool(np.isfinite(lengths).all() and (lengths > 1e-6).all())
        if not usable:
            notes.append("ignored the normals, as some are zero or not finite")
        normals = normals / lengths if usable else None
    known = str(arrays["unit"]) if "unit" in arrays else None
    points = near_origin(to_metres(arrays["vertices"], unit or known, path, job), path, job)
    if job is not None:
        for note in notes:
            job.note(f"{path.name}: {note}")
    return PointCloud(points, normals, arrays.get("colors"))


def read_own_cloud(path: Path) -> PointCloud:
    """Read a cloud that `write_ply` wrote.

    Raises:
        InputError: no such file; FormatError: damaged since.
    """
    path = check_file(Path(path), {".ply"}, _LIMIT_BYTES)
    arrays = parse_ply(str(path))
    return PointCloud(arrays["vertices"], arrays.get("normals"), arrays.get("colors"))
