"""Triangle meshes from foreign files, and PLY files of meshes and clouds.

The parsers are our own and short: the usual ones take a file that promises two thousand million vertices for four
points, a face line cut in half for no face, and glTF indices beyond the last vertex for valid (all tried). trimesh 5.2
stops at an OFF polygon of five corners, and its import takes six times as long as our reading of an STL file.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.bodies.makehuman import BASE, parse_makehuman
from vto_pipeline.io.bodies.smpl import parse_smpl
from vto_pipeline.io.files import check_file, replacing
from vto_pipeline.io.formats.clean_up import check_sound, drop_degenerate, merge_duplicate_vertices, turn_outward
from vto_pipeline.io.formats.obj import parse_obj
from vto_pipeline.io.formats.off import parse_off
from vto_pipeline.io.formats.ply import parse_ply
from vto_pipeline.io.formats.ply_header import ARBITRARY
from vto_pipeline.io.formats.stl import parse_stl
from vto_pipeline.io.gltf.read import parse_gltf
from vto_pipeline.io.lengths import near_origin, to_metres
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, Skin, TriangleMesh

PARSERS: dict[str, Callable[[str], Arrays]] = {
    ".ply": parse_ply,
    ".obj": parse_obj,
    ".stl": parse_stl,
    ".off": parse_off,
    ".glb": parse_gltf,
    ".gltf": parse_gltf,
    ".npz": parse_smpl,
}
"""Suffix -> parser."""

_LIMIT_BYTES = 1_000_000_000


def read_mesh(path: Path, *, unit: str | None = None, job: Job | None = None) -> TriangleMesh:
    """Read a foreign mesh: parsed in a limited child process, checked, cleaned, scaled to metres.

    Args:
        path: PLY, OBJ, STL, OFF, glTF or GLB; a body model (.npz) or a MakeHuman folder at rest.
        unit: Unit of length in the file, a key of `units.LENGTH_M`; None: guessed from the size.
        job: Notified of the guessed unit and of every change.

    Returns:
        The mesh [m]; the axes are the file's, moved by whole kilometres where it lies far out. Without a unit, a
        file of ours that says its unit is unknown stays so.

    Raises:
        InputError: no such file, or no unit fits; FormatError: the file breaks its format or holds no sound mesh.
    """
    path = Path(path)
    arrays = parse(path)
    suffix = path.suffix.lower()
    notes = [str(note) for note in arrays.pop("notes", np.empty(0))]
    if not len(arrays.get("faces", ())):
        problem = f"there are {len(arrays['vertices'])} points and no faces; expected a mesh"
        raise FormatError(problem, where=str(path), hint="if it is a point cloud, give it as a cloud")
    check_sound(arrays, path)
    if suffix == ".stl":
        arrays, more = merge_duplicate_vertices(arrays)
        notes += more
    count = len(arrays["vertices"])
    arrays, needless = drop_degenerate(arrays)
    arrays, turned = turn_outward(arrays)
    metric = unit is not None or "arbitrary" not in arrays
    vertices = arrays["vertices"]
    if metric:
        vertices = near_origin(to_metres(vertices, unit, path, job), path, job)
    if job is not None:
        for note in notes + needless + turned:
            job.note(f"{path.name}: {note}")
        if (
            suffix == ".obj" and len(vertices) < count
        ):  # OBJ counts nothing, so that a cut between two lines leaves no trace
            job.warn(f"{path.name}: {count - len(vertices)} vertices belong to no face: is the file truncated?")
    try:
        texture = arrays.get("texture")
        skin = Skin(arrays["places"], arrays["picture"]) if "picture" in arrays else None
        return TriangleMesh(vertices, arrays["faces"], arrays.get("colors"), texture, metric, skin)
    except InputError as e:
        raise FormatError(e.problem, where=str(path), hint=e.hint) from None


def parse(path: Path) -> Arrays:
    """Parse a file, or a MakeHuman folder, in a limited child process.

    Raises:
        InputError: no such file; FormatError: the file breaks its format.
    """
    path = Path(path)
    if (path / BASE).is_file():
        return run_limited(parse_makehuman, str(path.resolve()), where=str(path))
    path = check_file(path, PARSERS, _LIMIT_BYTES)
    return run_limited(PARSERS[path.suffix.lower()], str(path.resolve()), where=str(path))


def read_own_mesh(path: Path) -> TriangleMesh:
    """Read a mesh that `write_ply` wrote, without child process or cleaning.

    Raises:
        InputError: no such file; FormatError: damaged since.
    """
    path = check_file(Path(path), {".ply"}, _LIMIT_BYTES)
    arrays = parse_ply(str(path))
    if "faces" not in arrays:
        raise FormatError("points without faces; expected a mesh", where=str(path))
    metric = "arbitrary" not in arrays
    return TriangleMesh(arrays["vertices"], arrays["faces"], arrays.get("colors"), metric=metric)


def write_ply(path: Path, value: TriangleMesh | PointCloud) -> None:
    """Write a mesh or a cloud as binary PLY: doubles, so that reading gives the same bits back."""
    points = value.vertices if isinstance(value, TriangleMesh) else value.points
    normals = None if isinstance(value, TriangleMesh) else value.normals
    fields: list[tuple[str, str, np.ndarray]] = [(name, "<f8", points[:, i]) for i, name in enumerate("xyz")]
    if normals is not None:
        fields += [(f"n{name}", "<f8", normals[:, i]) for i, name in enumerate("xyz")]
    if value.colors is not None:
        fields += [(name, "u1", value.colors[:, i]) for i, name in enumerate(("red", "green", "blue"))]
    table = np.empty(len(points), [(name, kind) for name, kind, _ in fields])
    for name, _, column in fields:
        table[name] = column
    unit = ARBITRARY if isinstance(value, TriangleMesh) and not value.metric else "metres"
    header = ["ply", "format binary_little_endian 1.0", f"comment {unit}, +Y up", f"element vertex {len(points)}"]
    header += [f"property {'double' if kind == '<f8' else 'uchar'} {name}" for name, kind, _ in fields]
    faces = b""
    if isinstance(value, TriangleMesh):
        header += [f"element face {len(value.faces)}", "property list uchar int vertex_indices"]
        rows = np.empty(len(value.faces), [("sides", "u1"), ("corners", "<i4", 3)])
        rows["sides"], rows["corners"] = 3, value.faces
        faces = rows.tobytes()
    with replacing(path) as beside:
        beside.write_bytes("\n".join([*header, "end_header\n"]).encode() + table.tobytes() + faces)
