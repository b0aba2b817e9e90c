"""The parts of a run or a mesh file, for other programs, and the names of files that they may go to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.companions import companions
from vto_pipeline.io.files import resolved
from vto_pipeline.model.render import GlbPart


def check_name(source: Path, path: Path, suffix: str) -> None:
    """Refuse a name that does not end with a suffix, and one that would replace what is read.

    Raises:
        ConfigError: it is such a name.
    """
    if path.suffix.lower() != suffix:
        raise ConfigError(f"{path.name!r} is not a name for this file", hint=f"its name ends with {suffix}")
    check_free(source, [path])


def check_free(source: Path, files: Iterable[Path]) -> None:
    """Refuse files that would replace a run's own, a mesh file, or what is read with it.

    Raises:
        ConfigError: one of them would.
    """
    read = {resolved(source), *(resolved(file) for file in companions(source).values())}
    for path in files:
        if resolved(path) in read or resolved(path).parent == resolved(source / "out"):
            raise ConfigError("the file would replace what it is made from", where=str(path))


def parts_of(source: Path) -> list[GlbPart]:
    """Return the render meshes of a run and their body, or a mesh file as one part.

    Raises:
        InputError: no render mesh; FormatError: a broken file.
    """
    from vto_pipeline.geometry.remeshing.seams import cut_open
    from vto_pipeline.geometry.topology import vertex_normals
    from vto_pipeline.io.meshes import read_mesh
    from vto_pipeline.pipeline.execution.folder import is_run
    from vto_pipeline.stages.entry.outcome import open_run
    from vto_pipeline.stages.entry.shown import shown_parts

    if source.is_dir() and is_run(source):
        return shown_parts(open_run(source))
    mesh = read_mesh(source)
    if mesh.skin is not None:
        return [cut_open(source.stem, replace(mesh, texture=mesh.skin.places), mesh.skin.picture)]
    return [GlbPart(source.stem, mesh, normals=vertex_normals(mesh))]
