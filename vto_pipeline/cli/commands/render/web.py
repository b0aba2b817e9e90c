"""A file for a web page."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.files import resolved
from vto_pipeline.model.render import GlbPart

TRIANGLES, SIDE_PX = 100_000, 2048
"""Most triangles of the file, and pixels of a picture's longer side."""


def check_name(source: Path, path: Path) -> None:
    """Refuse a name that does not end with .glb, and one that would overwrite what is read.

    Raises:
        ConfigError: it is such a name.
    """
    if path.suffix.lower() != ".glb":
        raise ConfigError(f"{path.name!r} is not a name for a web page's file", hint="its name ends with .glb")
    taken = resolved(path)
    if taken == resolved(source) or taken.parent == resolved(source / "out"):
        raise ConfigError("the file for web pages would replace what it is made from", where=str(path))


def write_web(source: Path, path: Path) -> dict[str, Any]:
    """Write what a run made, or a mesh file, as a GLB within a web page's limits; return what it came to.

    Raises:
        InputError: no render mesh, or it cannot be made small enough; FormatError: a broken file.
    """
    from vto_pipeline.io.gltf.web import write_web_glb
    from vto_pipeline.render.clear_body import clear_body
    from vto_pipeline.render.web import shrink_pictures, thin_parts

    began = time.perf_counter()
    parts, moved = clear_body(thin_parts(_parts(source), TRIANGLES))
    path.parent.mkdir(parents=True, exist_ok=True)
    quality = write_web_glb(path, shrink_pictures(parts, SIDE_PX))
    return {
        "file": str(path),
        "mb": round(path.stat().st_size / 1e6, 3),
        "triangles": sum(len(part.mesh.faces) for part in parts),
        "jpeg_quality": quality,
        "moved_out_of_body": moved,
        "seconds": round(time.perf_counter() - began, 3),
    }


def _parts(source: Path) -> list[GlbPart]:
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
