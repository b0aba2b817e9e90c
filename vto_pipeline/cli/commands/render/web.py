"""A file for a web page."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from vto_pipeline.cli.commands.render.parts import parts_of

TRIANGLES, SIDE_PX = 100_000, 2048
"""Most triangles of the file, and pixels of a picture's longer side."""


def write_web(source: Path, path: Path) -> dict[str, Any]:
    """Write what a run made, or a mesh file, as a GLB within a web page's limits; return what it came to.

    Raises:
        InputError: no render mesh, or it cannot be made small enough; FormatError: a broken file.
    """
    from vto_pipeline.io.gltf.web import write_web_glb
    from vto_pipeline.render.clear_body import clear_body
    from vto_pipeline.render.web import shrink_pictures, thin_parts

    began = time.perf_counter()
    parts, moved = clear_body(thin_parts(parts_of(source), TRIANGLES))
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
