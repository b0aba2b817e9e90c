"""The bench of garments on bodies: it outlives what fails, goes on where it was ended, and shows what became of all."""

import csv
import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from vto_pipeline.bench.drape import garments
from vto_pipeline.bench.drape.garments import summary
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.tint import CLOTH


def row(**other):
    return {"outcome": "done", "settled": True, "crossings": 0, "too_small": False, "seconds": 10.0} | other


def test_the_summary_counts_garments_that_are_large_enough_apart():
    rows = [
        row(),
        row(seconds=30.0, crossings=2),
        row(seconds=20.0, settled=False),
        row(outcome="failed", seconds=99.0, settled=None, crossings=None),
        row(too_small=True, outcome="failed", seconds=7.0),
        row(too_small=True, seconds=5.0),
    ]
    first, times, small, others = summary(rows)
    assert first == ("6 runs, 4 of garments that are large enough: 3 of them done, 2 at rest, 1 with crossings")
    assert times == "these took 20.0 s (median), 30.0 s at most"
    assert small == "2 garments too small: 1 done all the same"
    assert others == "the others ended after 7.0 s (median), 7.0 s at most"


def rod(radius, low, high, edge, lids):
    """A cylinder about the y axis, with or without its lids [m]."""
    mesh = trimesh.creation.cylinder(radius, high - low, sections=int(2 * np.pi * radius / edge))
    faces = mesh.faces if lids else mesh.faces[np.abs(mesh.face_normals[:, 2]) < 0.5]
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, faces, edge)
    whole = trimesh.Trimesh(vertices, faces)
    up = whole.vertices[:, [1, 2, 0]] + [0.0, 0.5 * (low + high), 0.0]
    return TriangleMesh(up, whole.faces.astype(np.int32))


def test_rows_are_drawn_at_random_and_no_row_twice(tmp_path, monkeypatch):
    drawn = {}
    monkeypatch.setattr(garments, "drape_row", lambda *given: drawn[seed].append(given[:3]) or row())
    monkeypatch.setattr(garments, "write_picture_table", lambda *given: None)
    monkeypatch.setattr(garments.LiveRows, "add", lambda *given: None)
    names = ["--garment", "a", "b", "c", "--body", "d", "e", "--fabric", "f", "g", "h"]
    for seed in ("0", "1", "2"):
        drawn[seed] = []
        given = ["garments", *names, "--out", str(tmp_path / seed), "--sample", "12", "--seed", seed]
        monkeypatch.setattr("sys.argv", given)
        garments.main()
    assert [len(set(rows)) for rows in drawn.values()] == [12, 12, 12]
    assert len(set.union(*map(set, drawn.values()))) == 18
    assert drawn["1"] != drawn["2"]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Two garments on one body, one of them no mesh at all; run twice, the second time after another body's."""
    folder = tmp_path_factory.mktemp("bench")
    body, band, broken = (folder / name for name in ("rod.ply", "band.ply", "broken.ply"))
    write_ply(body, rod(0.15, 0.0, 1.0, 0.04, lids=True))
    write_ply(band, rod(0.152, 0.4, 0.7, 0.04, lids=False))
    broken.write_text("no mesh")
    given = ["--garment", str(band), str(broken), "--body", str(body), "--out", str(folder / "out")]
    given += ["--set", "simulation_mesh.edge_mm=40", "drape.target_error_mm=5"]
    with pytest.MonkeyPatch.context() as patch:
        for times in range(2):
            patch.setattr("sys.argv", ["garments", *given])
            garments.main()
            if times == 0:
                rows = folder / "out" / "rows.jsonl"
                other = json.loads(rows.read_text().splitlines()[0]) | {"body": "another"}
                rows.write_text(rows.read_text() + json.dumps(other) + "\n")
                first = rows.read_text()
    return folder / "out", first


def test_a_file_that_is_no_mesh_costs_no_other_run(bench):
    rows = {one["garment"]: one for one in map(json.loads, bench[1].splitlines()[:2])}
    assert rows["band"]["outcome"] == "done"
    assert rows["band"]["crossings"] == 0
    assert rows["band"]["too_small"] is False
    assert rows["broken"]["outcome"] == "refused"
    assert "not a PLY file" in rows["broken"]["said"]


def test_begun_again_it_runs_only_what_is_missing(bench):
    assert (bench[0] / "rows.jsonl").read_text() == bench[1]


def test_the_table_has_all_rows(bench):
    with (bench[0] / "rows.csv").open(newline="") as file:
        assert [one["garment"] for one in csv.DictReader(file)] == ["band", "broken", "band"]


def test_the_picture_shows_the_cloth_where_there_is_any(bench):
    picture = np.asarray(Image.open(bench[0] / "table.png"), dtype=float)
    upper, lower = np.array_split(picture, 2)
    bluish = [(part[..., 2] - part[..., 0] > 0.5 * (CLOTH[2] - CLOTH[0])).mean() for part in (upper, lower)]
    assert bluish[0] > 0.02
    assert bluish[1] == 0.0
