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


def write_las(path: Path, points: np.ndarray, colors: np.ndarray) -> None:
    """A LAS or LAZ file by laspy, in steps of 0.1 mm, with colours of 16 bits as the standard has it."""
    import laspy

    las = laspy.create(point_format=2, file_version="1.2")
    las.header.scales = np.full(3, 1e-4)
    las.x, las.y, las.z = points.T
    las.red, las.green, las.blue = (257 * colors.T.astype(np.uint16)).astype(np.uint16)
    las.write(path)


def write_pts(path: Path, points: np.ndarray, colors: np.ndarray) -> None:
    """A PTS file as Leica's programs write it."""
    lines = [f"{x:.9f} {y:.9f} {z:.9f} -1024 {r} {g} {b}" for (x, y, z), (r, g, b) in zip(points, colors, strict=True)]
    path.write_text("\n".join([str(len(points)), *lines]) + "\n")


def write_e57(
    path: Path,
    scans: list[np.ndarray],
    colors: list[np.ndarray],
    poses: list[tuple[np.ndarray, np.ndarray]] | None = None,
) -> None:
    """An E57 file by pye57; poses are rotation and translation from each scan to the file's frame."""
    import pye57
    from scipy.spatial.transform import Rotation

    with pye57.E57(str(path), mode="w") as opened:
        for index, (points, color) in enumerate(zip(scans, colors, strict=True)):
            fields = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), np.ascontiguousarray(points.T), strict=True))
            parts = np.ascontiguousarray(color.T.astype(np.uint8))
            fields |= dict(zip(("colorRed", "colorGreen", "colorBlue"), parts, strict=True))
            turn, shift = (np.eye(3), np.zeros(3)) if poses is None else poses[index]
            x, y, z, w = Rotation.from_matrix(turn).as_quat()
            opened.write_scan_raw(fields, rotation=np.array([w, x, y, z]), translation=shift)
