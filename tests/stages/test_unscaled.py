"""A surface whose unit nobody knows: told in its file, in the report, and refused wherever metres are needed."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from vto_pipeline.cli.main import main
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_mesh, read_own_mesh, write_ply
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages.scan_report import scan_report


@pytest.fixture
def unscaled(tmp_path: Path) -> Path:
    """An open tube of 9 units, in a file that says that they are arbitrary."""
    tube = trimesh.creation.cylinder(radius=2.0, height=9.0, sections=40).subdivide().subdivide()
    side = np.abs(tube.face_normals[:, 2]) < 0.5
    write_ply(tmp_path / "scan.ply", TriangleMesh(tube.vertices, tube.faces[side], metric=False))
    return tmp_path / "scan.ply"


def test_the_file_says_that_its_unit_is_unknown(unscaled: Path) -> None:
    assert not read_own_mesh(unscaled).metric
    received = read_mesh(unscaled)
    assert not received.metric  # 9 would pass for decimetres
    assert np.ptp(received.vertices, axis=0).max() == pytest.approx(9.0)
    stated = read_mesh(unscaled, unit="dm")
    assert stated.metric
    assert np.ptp(stated.vertices, axis=0).max() == pytest.approx(0.9)


@pytest.mark.parametrize(
    "command",
    [
        ["scan", "{}", "--role", "garment"],
        ["fit", "--scan", "{}"],
        ["drape", "--garment", "{}", "--body", "{}"],
    ],
)
def test_what_needs_metres_refuses_and_says_what_to_add(unscaled: Path, command: list[str], tmp_path, capsys) -> None:
    words = [word.format(unscaled) for word in command]
    assert main([*words, "-o", str(tmp_path / "run")]) == 4
    said = capsys.readouterr().err
    assert "no scale" in said
    assert "--distance" in said


def test_a_mannequin_without_scale_scales_nothing(unscaled: Path, tmp_path, capsys) -> None:
    command = ["scan", str(unscaled), "--role", "garment", "--mannequin", str(unscaled), "-o", str(tmp_path / "run")]
    assert main(command) == 4
    assert "mannequin needs metres" in capsys.readouterr().err


def test_a_bare_scan_is_kept_and_called_not_metric(unscaled: Path, tmp_path) -> None:
    assert main(["scan", str(unscaled), "--role", "mannequin", "-o", str(tmp_path / "run")]) == 0
    report = read_json(tmp_path / "run" / "out" / "scan_report.json")
    assert report["metric"] is False
    assert report["scale"]["source"] is None
    assert main(["report", str(tmp_path / "run")]) == 0


def stage(name, **metrics):
    return {"name": name, "status": "ran", "metrics": metrics}


def test_the_mannequin_makes_a_scan_of_unknown_scale_metric() -> None:
    stages = [
        stage("garment.sfm", registered=34, photos=36, left_out_photos={"a.jpg": "dark", "b.jpg": "blurred"}),
        stage("garment.scale"),
        stage("body.scale", scale_source="board", scale_error_percent=0.01),
        stage("garment.fuse_photos", coverage=0.7),
        stage("align", scale_source="mannequin", metres_per_unit=0.2, scale_error_percent=0.3),
        stage("openings", openings=4, unobserved_share=0.04),
    ]
    report = scan_report("garment", False, {"stages": stages})
    assert report["metric"] is True
    assert report["scale"] == {"source": "mannequin", "metres_per_unit_of_surface": 0.2, "error_percent": 0.3}
    assert (report["coverage"], report["openings"], report["used"], report["given"]) == (0.7, 4, 34, 36)
    assert report["left_out"]["b.jpg"] == "blurred"
    assert scan_report("garment", False, {"stages": stages[:4]})["metric"] is False
