"""The examples of docs/python.md, run as they stand, in their order, on the sample data."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.io.meshes import write_ply
from vto_pipeline.model.mesh import TriangleMesh

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), flags=re.S)
GIVEN = {
    "shirt.ply": "shirt_on_form/shirt.ply",
    "form.ply": "shirt_on_form/form.ply",
    "customer.yaml": "customer/measurements.yaml",
    "cloud.ply": "customer/cloud.ply",
}


def towel() -> TriangleMesh:
    """A square of 32 x 32 vertices, hung by two corners above the origin."""
    across, down = np.meshgrid(np.linspace(-0.4, 0.4, 32), np.linspace(0.0, 0.8, 32))
    vertices = np.column_stack([across.ravel(), 0.9 - 0.0 * down.ravel(), down.ravel() - 0.4])
    corner = np.arange(31 * 32).reshape(31, 32)[:, :-1].ravel()
    one = np.column_stack([corner, corner + 32, corner + 1])
    return TriangleMesh(vertices, np.vstack([one, np.column_stack([corner + 1, corner + 32, corner + 33])]))


@pytest.mark.slow
def test_the_examples_of_the_page_run_as_they_stand(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, source in GIVEN.items():
        shutil.copy(ROOT / "sample_data" / source, name)
    write_ply(Path("towel.ply"), towel())
    names: dict = {}
    for block in BLOCKS:
        exec(compile(block, "docs/python.md", "exec"), names)
    printed = capsys.readouterr().out
    assert printed.startswith("3 given.body.measurements: no such file")
    assert "absent.yaml" in printed
    assert names["customer"].read("measurements").values["waist_girth"] == pytest.approx(0.75, abs=0.2)
    assert names["found"].path("page").is_file()
    assert names["open_run"]("runs/draft").verdicts == names["found"].verdicts
    heights = names["cloth"].positions[:, 1]
    assert heights.max() == pytest.approx(0.9, abs=1e-6)  # what is pinned stays
    assert heights.min() < 0.85
    assert np.linalg.norm(names["cloth"].positions, axis=1).min() > 0.3  # outside the ball


def test_every_example_is_python():
    assert len(BLOCKS) >= 4
    for block in BLOCKS:
        compile(block, "docs/python.md", "exec")
