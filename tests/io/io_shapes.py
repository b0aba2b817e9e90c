"""A mesh to write and read: a capsule the size of a person, with colours; and what may happen to a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

DAMAGES = 200


def capsule() -> Any:
    """1.7 m long, made by trimesh, with colours of its own per vertex."""
    import trimesh

    mesh = trimesh.creation.capsule(height=1.3, radius=0.2, count=[8, 8])
    mesh.merge_vertices()
    rng = np.random.default_rng(3)
    mesh.visual.vertex_colors = np.column_stack(
        [rng.integers(0, 256, (len(mesh.vertices), 3)), np.full(len(mesh.vertices), 255)]
    ).astype(np.uint8)
    return mesh


def write_all_formats(folder: Path) -> dict[str, Path]:
    """The capsule in every mesh format, written by trimesh."""
    mesh = capsule()
    files = {}
    for name, suffix, options in (
        ("ply", ".ply", {}),
        ("ply_ascii", ".ply", {"encoding": "ascii"}),
        ("obj", ".obj", {}),
        ("stl", ".stl", {}),
        ("stl_ascii", ".stl", {}),
        ("off", ".off", {}),
        ("glb", ".glb", {}),
    ):
        files[name] = folder / f"{name}{suffix}"
        kind = "ply" if name == "ply_ascii" else name
        mesh.export(files[name], file_type=kind, **options)
    return files


def damages(data: bytes, rng: np.random.Generator) -> list[bytes]:
    """A quarter cut short, a quarter with changes in the header (first 400 bytes), the rest with changes anywhere."""
    found = []
    for i in range(DAMAGES):
        damaged = np.frombuffer(data, np.uint8).copy()
        if i % 4 == 0:
            damaged = damaged[: rng.integers(1, len(data))]
        else:
            reach = min(len(data), 400) if i % 4 == 1 else len(data)
            damaged[rng.integers(0, reach, rng.integers(1, 9))] = rng.integers(0, 256)
        found.append(damaged.tobytes())
    return found
