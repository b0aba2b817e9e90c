"""vto between."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.io.meshes import read_mesh, write_ply
from vto_pipeline.model.mesh import TriangleMesh


def write_square(path: Path, side_cm: float) -> None:
    """A square panel of GarmentCode."""
    corners = [[0, 0], [side_cm, 0], [side_cm, side_cm], [0, side_cm]]
    edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    path.write_text(json.dumps({"pattern": {"panels": {"front": {"vertices": corners, "edges": edges}}}}))


def test_patterns_and_meshes_between_two(vto):
    for name, side in (("s", 30), ("l", 40)):
        write_square(Path(f"{name}.json"), side)
        write_ply(Path(f"{name}.ply"), TriangleMesh(np.diag([0.01 * side] * 3), [[0, 1, 2]]))
    assert vto("between", "s.json", "l.json", "--share", "0.25", "-o", "m.json", "--json").data["panels"] == 1
    corners = json.loads(Path("m.json").read_text())["panels"][0]["edges"][1]["points"]
    assert np.array(corners) == pytest.approx(np.array([[0.325, 0], [0.325, 0.325]]))
    assert vto("between", "s.ply", "l.ply", "-o", "m.ply").code == 0
    assert np.sort(read_mesh(Path("m.ply")).vertices.ravel())[-3:] == pytest.approx([0.35] * 3)
    assert vto("between", "s.ply", "l.json", "-o", "x.ply").code == 3
    assert vto("between", "s.ply", "l.ply", "-o", "l.ply").code == 2
    assert vto("between", "s.ply", "l.ply", "-o", "x.obj").code == 2
    assert vto("between", "s.json", "l.json", "--share", "2", "-o", "x.json").code == 2
