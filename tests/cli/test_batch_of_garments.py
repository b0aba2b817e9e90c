"""A real batch: skirts on customers with two workers, five rows with poisoned input among them."""

from __future__ import annotations

import json
import logging
import os
import time
from pathlib import Path

import pytest

from vto_pipeline.bench.samples.garments.skirt import make_skirt
from vto_pipeline.bench.samples.garments.wearer import wearer
from vto_pipeline.cli.main import main
from vto_pipeline.io.meshes import write_ply

pytest.importorskip("distributed")

RUN = """\
schema: 1
run:
  schema: 1
  given: {fabric: denim}
  want: [draped, fit_report]
  stages: {simulation_mesh: {edge_mm: 40}, drape: {place: as_it_stands}}
rows: rows.csv
"""
CUSTOMER = "sex: female\nunit: cm\nmeasurements: {{stature: 168, chest_girth: 97, waist_girth: 83, hip_girth: {hip}}}\n"


def poisoned(skirt: Path) -> dict[str, tuple[str, str]]:
    """Garments and customers of five rows, by name; what is not poisoned is as in other rows."""
    whole, content = skirt.read_bytes(), bytearray(skirt.read_bytes())
    Path("half.ply").write_bytes(whole[: len(whole) // 2])
    Path("picture.ply").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(1000))
    Path("empty.ply").touch()
    start = content.index(b"end_header\n") + len(b"end_header\n")
    content[start : start + 12] = b"\xff" * 12  # not a number, as float or as double
    Path("spots.ply").write_bytes(content)
    Path("giant.yaml").write_text(CUSTOMER.format(hip=10_500))
    return {
        "half": ("half.ply", "customer_0.yaml"),
        "picture": ("picture.ply", "customer_0.yaml"),
        "empty": ("empty.ply", "customer_0.yaml"),
        "spots": ("spots.ply", "customer_0.yaml"),
        "giant": (skirt.name, "giant.yaml"),
    }


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of dask and its worker processes
def test_every_garment_on_every_customer_and_poisoned_rows_fail_alone(tmp_path, monkeypatch, capfd):
    """VTO_BATCH=10 is a hundred rows; the log tells the wall time."""
    monkeypatch.chdir(tmp_path)
    side = int(os.environ.get("VTO_BATCH", "3"))
    for number in range(side):
        skirt = make_skirt(wearer("average"), 25.0, clearance=0.008 + 0.001 * number)
        write_ply(Path(f"skirt_{number}.ply"), skirt.mesh)
        Path(f"customer_{number}.yaml").write_text(CUSTOMER.format(hip=102 + number))
    good = {f"s{g}_c{c}": (f"skirt_{g}.ply", f"customer_{c}.yaml") for g in range(side) for c in range(side)}
    bad = poisoned(Path("skirt_0.ply"))
    lines = [f"{name},{garment},{customer}" for name, (garment, customer) in (good | bad).items()]
    Path("rows.csv").write_text("\n".join(["name,given.garment.mesh,given.body.measurements", *lines]) + "\n")
    Path("batch.yaml").write_text(RUN)
    began = time.monotonic()
    assert main(["batch", "batch.yaml", "-o", "out", "--workers", "2"]) == 6
    seconds = time.monotonic() - began
    rows = {row["name"]: row for row in json.loads(Path("out/batch.json").read_text())["rows"]}
    assert {name for name, row in rows.items() if row["status"] == "done"} == set(good)
    problems = {name: rows[name]["problem"] for name in bad}
    assert all(rows[name]["status"] in ("refused", "failed") for name in bad), problems
    assert len(set(problems.values())) == len(bad)
    stages = ("fit_measurements", "drape")
    made = [len(list(Path("out/cache", stage).glob("*/manifest.json"))) for stage in stages]
    assert made == [side, side**2]  # a body is fitted once for all of its garments
    logging.info("%d rows in %.0f s; poisoned: %s", len(rows), seconds, problems)
