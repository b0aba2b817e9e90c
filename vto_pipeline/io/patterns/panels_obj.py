"""A garment as OBJ whose texture coordinates are its panels in metres, as programs of pattern makers write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.io.files import replacing
from vto_pipeline.model.mesh import TriangleMesh


def write_panels_obj(path: Path, mesh: TriangleMesh) -> None:
    """Write a garment with its panels.

    Args:
        path: Of the OBJ file.
        mesh: Its texture coordinates are the panels [m].
    """
    assert mesh.texture is not None
    places, number = np.unique(mesh.texture.reshape(-1, 2), axis=0, return_inverse=True)
    corners = np.stack([mesh.faces, number.reshape(-1, 3)], axis=2) + 1
    lines = ["# metres, +Y up; texture coordinates are the panels in metres, v along the warp"]
    lines += [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"vt {u:.7f} {v:.7f}" for u, v in places.tolist()]
    lines += ["f " + " ".join(f"{vertex}/{place}" for vertex, place in face) for face in corners.tolist()]
    with replacing(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="ascii")
