"""What a path holds is detected and reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from io_shapes import write_all_formats
from PIL import Image

from vto_pipeline.errors import InputError
from vto_pipeline.io.arrays import write_arrays
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.io.sniff import find_kind
from vto_pipeline.model.mesh import PointCloud


def make(folder: Path) -> None:
    """One of each."""
    for name in ("photos", "depth/depth", "silhouettes", "empty"):
        (folder / name).mkdir(parents=True)
    for name in ("photos/a.jpg", "photos/b.jpg", "silhouettes/front.png", "silhouettes/side.png"):
        Image.new("RGB", (8, 8)).save(folder / name)
    (folder / "depth" / "intrinsics.json").write_text("{}")
    (folder / "silhouettes" / "stature.yaml").write_text("stature: 1.7")
    (folder / "customer.yaml").write_text("measurements: {stature: 170}")
    (folder / "config.yaml").write_text("given: {}")
    (folder / "scan.xyz").write_text("0 0 0\n")
    (folder / "scan.pcd").write_text("VERSION 0.7\n")
    (folder / "notes.docx").write_text("no")
    (folder / "poplin.yaml").write_text("areal_density_gsm: 120")
    (folder / "wool.yaml").write_text("instrument: KES-FB")
    (folder / "wool.csv").write_text("\ufeffinstrument; KES-FB\nW; 16,29\n")
    (folder / "lining.u3m").write_text('{"schema": "1.1", "material": {}}')
    (folder / "lining.json").write_text('{"schema": "1.0", "raw_data": {}}')
    write_arrays(folder / "avatar.npz", {})
    write_ply(folder / "cloud.ply", PointCloud(np.zeros((3, 3))))
    write_all_formats(folder)


@pytest.mark.parametrize(
    ("name", "kind", "reason"),
    [
        ("photos", "photos", "2 pictures"),
        ("depth", "depth", "intrinsics.json and depth/"),
        ("silhouettes", "silhouettes", "front and side"),
        ("customer.yaml", "measurements", "key measurements"),
        ("poplin.yaml", "fabric", "areal_density_gsm"),
        ("wool.yaml", "fabric", "key instrument"),
        ("wool.csv", "fabric", "sheet"),
        ("lining.u3m", "fabric", "U3M"),
        ("lining.json", "fabric", "U3M"),
        ("scan.xyz", "cloud", ".xyz"),
        ("scan.pcd", "cloud", ".pcd"),
        ("cloud.ply", "cloud", "points and no faces"),
        ("avatar.npz", "avatar", ".npz"),
        ("ply.ply", "surface", "128 faces"),
        ("ply_ascii.ply", "surface", "128 faces"),
        ("obj.obj", "surface", ".obj"),
        ("glb.glb", "surface", ".glb"),
    ],
)
def test_what_it_is_and_why(tmp_path: Path, name: str, kind: str, reason: str) -> None:
    make(tmp_path)
    found, why = find_kind(tmp_path / name)
    assert found == kind
    assert reason in why


@pytest.mark.parametrize("name", ["empty", "config.yaml", "notes.docx"])
def test_what_is_unclear_is_asked(tmp_path: Path, name: str) -> None:
    make(tmp_path)
    with pytest.raises(InputError, match="cannot tell what this is") as caught:
        find_kind(tmp_path / name)
    assert "a folder of photos" in caught.value.hint
    with pytest.raises(InputError, match="no such file or folder"):
        find_kind(tmp_path / "nowhere")
