"""`vto scan` on the sample customer's cloud: the surface lies under the name that the contract gives it."""

from pathlib import Path

import numpy as np

from vto_pipeline.avatar.template.template import template
from vto_pipeline.bench.demo import distances
from vto_pipeline.cli.main import main
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages.scan_report import STAGES

SAMPLES = Path(__file__).resolve().parents[2] / "sample_data"


def test_a_scanned_body_is_the_surface_of_its_run(tmp_path: Path) -> None:
    command = ["scan", str(SAMPLES / "customer" / "cloud.ply"), "--role", "body", "-o", str(tmp_path / "run")]
    assert main(command) == 0
    out = tmp_path / "run" / "out"
    assert (out / "surface.ply").read_bytes() == (out / "body_surface.ply").read_bytes()
    off = distances(read_own_mesh(out / "surface.ply"), read_own_mesh(SAMPLES / "truth" / "customer_body.ply"))
    assert 5e-5 < np.median(off) < 1e-3  # [m]; the scanner's noise is 0.3 mm: neither worse than thrice nor without it


def test_a_scanned_body_in_inches_is_warned_of() -> None:
    """Read as centimetres it is 0.39 times as tall. What has no scale, and a mannequin, may have any size."""
    report = {stage.name: stage for stage in STAGES}
    body = template().mesh
    for role, times, metric, warned in (
        ("body", 0.3937, True, 1),
        ("body", 1.0, True, 0),
        ("body", 0.3937, False, 0),
        ("mannequin", 0.3937, True, 0),
    ):
        job, stage = Job(), report[f"{role}.scan_report"]
        surface = TriangleMesh(times * body.vertices, body.faces, metric=metric)
        stage.run({f"{role}_surface": surface, "run_record": {"stages": []}}, stage.settings(), job)
        assert ["in inches" in text for text in job.warnings] == [True] * warned
