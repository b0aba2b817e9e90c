"""Damaged files of every format: an error or a sound value, never a crash, a hang, or something between.

All damages of one format run in one limited child, as a parser does, so that a crash or a hang is seen as such.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from io_shapes import DAMAGES, capsule, damages, write_all_formats, write_e57, write_las, write_pts
from PIL import Image

from vto_pipeline.errors import InputError
from vto_pipeline.io import clouds, meshes
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.captures import images
from vto_pipeline.io.formats.clean_up import check_sound, drop_degenerate
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.mesh import PointCloud, TriangleMesh


def read_damaged(name: str) -> Arrays:
    """In the child: read every damaged copy of a file.

    Returns:
        refused, sound: how many were; shorter: how many cut copies gave a sound mesh.
    """
    warnings.simplefilter("ignore")
    path = Path(name)
    rng = np.random.default_rng(11)
    copy = Path(f"damaged{path.suffix}")
    refused = sound = shorter = 0
    for i, data in enumerate(damages(path.read_bytes(), rng)):
        copy.write_bytes(data)
        try:
            read_one(copy)
            sound += 1
            shorter += i % 4 == 0
        except InputError:
            refused += 1
    return {"refused": np.array(refused), "sound": np.array(sound), "shorter": np.array(shorter)}


def read_one(path: Path) -> None:
    """What reading in earnest does, in this process; the model's constructors check what comes out."""
    suffix = path.suffix
    if suffix in images.SUFFIXES:
        images.decode_all(str(path))
        return
    is_mesh = suffix in meshes.PARSERS
    arrays = (meshes.PARSERS if is_mesh else clouds.PARSERS)[suffix](str(path))
    check_sound(arrays, path)
    if not is_mesh or "faces" not in arrays:
        PointCloud(arrays["vertices"])
        return
    arrays, _ = drop_degenerate(arrays)
    TriangleMesh(arrays["vertices"], arrays["faces"], arrays.get("colors"))


def write_compressed(path: Path, points: np.ndarray) -> None:
    """A compressed cloud by Open3D."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    o3d.io.write_point_cloud(str(path), cloud, compressed=True)


def write_others(folder: Path) -> dict[str, Path]:
    """Clouds and pictures."""
    points = np.array(capsule().vertices)
    files = {name: folder / name for name in OTHERS}
    np.savetxt(files["a.xyz"], points)
    header = f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nDAMAGES 1 1 1\nPOINTS {len(points)}\nDATA "
    files["ascii.pcd"].write_text(header + "ascii\n" + "\n".join(" ".join(map(str, p)) for p in points) + "\n")
    files["binary.pcd"].write_bytes(f"{header}binary\n".encode() + points.astype("<f4").tobytes())
    write_compressed(files["compressed.pcd"], points)
    rng = np.random.default_rng(12)
    picture = Image.fromarray(rng.integers(0, 256, (30, 40, 3)).astype(np.uint8))
    tags = picture.getexif()
    tags.get_ifd(34665)[41989] = 50
    for name in ("a.png", "a.jpg", "a.tif"):
        picture.save(files[name], exif=tags)
    Image.fromarray(rng.integers(0, 65536, (30, 40)).astype(np.uint16)).save(files["deep.png"])
    colors = rng.integers(0, 256, points.shape)
    for name in ("a.las", "a.laz"):
        write_las(files[name], points, colors)
    write_e57(files["a.e57"], [points], [colors])
    write_pts(files["a.pts"], points, colors)
    return files


MESHES = ["ply", "ply_ascii", "obj", "stl", "stl_ascii", "off", "glb"]
OTHERS = ["a.xyz", "a.pts", "ascii.pcd", "binary.pcd", "compressed.pcd", "a.las", "a.laz", "a.e57"]
OTHERS += ["a.png", "a.jpg", "a.tif", "deep.png"]


@pytest.mark.parametrize("name", MESHES + OTHERS)
def test_damaged_files_are_refused_or_sound(tmp_path: Path, name: str) -> None:
    path = (write_all_formats(tmp_path) if name in MESHES else write_others(tmp_path))[name]
    read_one(path)  # undamaged
    counts = run_limited(read_damaged, str(path), seconds=600.0)
    refused, sound = int(counts["refused"]), int(counts["sound"])
    assert refused + sound == DAMAGES
    assert refused > DAMAGES // 8  # most cuts at least
    if name not in ("obj", "a.xyz"):  # these two count nothing, so that a cut between two lines leaves no trace
        assert int(counts["shorter"]) <= (2 if name in ("a.jpg", "ply_ascii", "ascii.pcd", "off", "stl_ascii") else 0)
