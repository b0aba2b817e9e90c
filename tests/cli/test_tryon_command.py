"""vto tryon, on a batch whose runs are written by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.io.documents import write_json
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.pipeline.batch.ledger import Ledger
from vto_pipeline.pipeline.batch.row import RowResult
from vto_pipeline.stages.entry import planning

CATALOGUE = planning.catalogue()

ORDER = """\
schema: 1
run: {schema: 1, given: {body: {measurements: {sex: female, unit: cm, measurements: {stature: 1}}}}, want: [page]}
every: {given.body.measurements.measurements.stature: [160, 170, 190], given.fabric: [denim, silk]}
"""
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
UP = np.array([0.0, 0.0, 1.0])


def write_run(folder: Path, height: float, faces: list[list[int]], ease: float = 0.01) -> None:
    """A square of cloth that lies above a pyramid."""
    out = folder / "out"
    out.mkdir(parents=True)
    top = np.vstack([SQUARE - 0.5 * UP, [[0.5, 0.5, -1.0]]])
    body = [[0, 1, 2], [0, 2, 3], [1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]]
    zone = {"zone": "hem", "ease_m": ease}
    made = {
        "draped": TriangleMesh(SQUARE + height * UP, np.array(faces)),
        "collider": MovingBody(top[None], np.array(body)),
        "fit_report": {"schema": 1, "verdict": "it fits", "zones": [zone]},
    }
    for name, value in made.items():
        kind = CATALOGUE.kind(name)
        kind.write(out / kind.filename, value)
    record = {"schema": 1, "wanted": [*made], "stages": [], "given": {}, "seed": 0, "seconds": 1.0}
    write_json(folder / "run.json", record)


@pytest.fixture
def batch(vto, monkeypatch):
    """A batch of cloth whose height is the square of the stature, in metres."""
    monkeypatch.setattr(planning, "catalogue", lambda: CATALOGUE)  # not the toy tables
    Path("sizes.yaml").write_text(ORDER)
    names = [f"row_{k}" for k in range(1, 7)]
    ledger = Ledger(_made(Path("runs/sizes")), names)
    nodes = [(stature, ease) for stature in (160, 170, 190) for ease in (0.01, 0.02)]
    for name, (stature, ease) in zip(names, nodes, strict=True):
        write_run(Path("runs/sizes/rows") / name, (stature / 100) ** 2, [[0, 1, 2], [0, 2, 3]], ease)
        ledger.enter(RowResult(name, "key", "done", 0, 1.0, 1.0, 1), "it fits")
    ledger.save()
    return Path("runs/sizes")


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True)
    return folder


def test_a_batch_becomes_a_page_that_says_how_far_it_is_off(vto, batch):
    told = vto("tryon", "sizes.yaml", "--json").data
    assert told["page"] == str((batch / "try_on.html").absolute())
    chord = 1.6**2 + (1.9**2 - 1.6**2) / 3 - 1.7**2
    assert told["left_out"] == pytest.approx(dict.fromkeys(("median_mm", "p95_mm", "most_mm"), 1e3 * chord))
    assert told["inside_mm"] == 0.0
    page = (batch / "try_on.html").read_text()
    grid = json.loads(page.split('id="grid">')[1].split("</script>")[0])
    assert grid["sliders"] == [{"name": "stature", "unit": "cm", "values": [160, 170, 190]}]
    assert grid["choices"] == [{"name": "fabric", "options": ["denim", "silk"]}]
    assert grid["fitted"][1]["fits"] == [{"verdict": "it fits", "ease_cm": {"hem": 2.0}}] * 3


def test_a_drape_that_warns_warns_on_the_page(vto, batch):
    record = json.loads((batch / "rows/row_1/run.json").read_text())
    record["stages"] = [{"name": "drape", "status": "ran", "key": "k", "warnings": ["not at rest"]}]
    write_json(batch / "rows/row_1/run.json", record)
    assert vto("tryon", "sizes.yaml").code == 0
    grid = json.loads((batch / "try_on.html").read_text().split('id="grid">')[1].split("</script>")[0])
    told = [fit["verdict"] for one in grid["fitted"] for fit in one["fits"]]
    assert sorted(told) == ["it fits"] * 5 + ["it fits; warning: not at rest"]


def test_rows_that_are_not_done_are_named(vto, batch):
    ledger = Ledger(batch, [f"row_{k}" for k in range(1, 7)])
    ledger.enter(RowResult("row_4", "key", "failed", 4, 1.0, 1.0, 1, "it tore"), "")
    ledger.save()
    failed = vto("tryon", "sizes.yaml")
    assert failed.code == 3
    assert "1 of 6 rows are not done: row_4" in failed.err


def test_other_triangles_cannot_be_interpolated(vto, batch):
    write_run(Path("other"), 1.0, [[0, 1, 3], [1, 2, 3]])
    Path("other/out/draped.ply").replace(batch / "rows/row_3/out/draped.ply")
    failed = vto("tryon", "sizes.yaml")
    assert failed.code == 4
    assert "nothing lies between" in failed.err
