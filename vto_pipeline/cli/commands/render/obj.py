"""An OBJ file for other programs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from vto_pipeline.cli.commands.render.parts import check_free, parts_of


def write_obj_files(source: Path, path: Path) -> dict[str, Any]:
    """Write what a run made, or a mesh file, as OBJ with materials and pictures; return what it came to.

    Raises:
        InputError: no render mesh; FormatError: a broken file; ConfigError: an input would be replaced.
    """
    from vto_pipeline.io.formats.obj_parts import obj_files, write_obj

    began = time.perf_counter()
    parts = parts_of(source)
    files = list(obj_files(path, parts).values())
    check_free(source, files)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_obj(path, parts)
    return {
        "file": str(path),
        "files": [str(file) for file in files],
        "triangles": sum(len(part.mesh.faces) for part in parts),
        "seconds": round(time.perf_counter() - began, 3),
    }
