"""Trousers by others on a person who sits down: their groins close on cloth, and no frame may be left crossing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

PANTS = Path(__file__).parents[3] / "shared" / "data" / "garments" / "berkeley" / "pants" / "pants-iso.obj"


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not PANTS.exists(), reason="shared data absent")
def test_no_frame_is_left_crossing(tmp_path: Path) -> None:
    bench = [sys.executable, "-m", "vto_pipeline.bench.motion.garments", "--garment", str(PANTS), "--motion", "sitting"]
    bench += ["--set", "simulation_mesh.edge_mm=30", "--out", str(tmp_path)]
    subprocess.run(bench, check=True, capture_output=True)
    row = json.loads((tmp_path / "rows.jsonl").read_text().splitlines()[0])
    assert row["frames"] == 46
    assert row["ipc_crossing"] == 0  # with four tries a frame, 2
