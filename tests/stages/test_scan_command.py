"""`vto scan` on the sample customer's cloud: the surface lies under the name that the contract gives it."""

from pathlib import Path

import numpy as np

from vto_pipeline.bench.demo import distances
from vto_pipeline.cli.main import main
from vto_pipeline.io.meshes import read_own_mesh

SAMPLES = Path(__file__).resolve().parents[2] / "sample_data"


def test_a_scanned_body_is_the_surface_of_its_run(tmp_path: Path) -> None:
    command = ["scan", str(SAMPLES / "customer" / "cloud.ply"), "--role", "body", "-o", str(tmp_path / "run")]
    assert main(command) == 0
    out = tmp_path / "run" / "out"
    assert (out / "surface.ply").read_bytes() == (out / "body_surface.ply").read_bytes()
    off = distances(read_own_mesh(out / "surface.ply"), read_own_mesh(SAMPLES / "truth" / "customer_body.ply"))
    assert 5e-5 < np.median(off) < 1e-3  # [m]; the scanner's noise is 0.3 mm: neither worse than thrice nor without it
