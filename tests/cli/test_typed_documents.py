"""scan, fit and drape only write a document: the right one, or a refusal."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from vto_pipeline.cli import results

PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
CLOUD = PLY + "end_header\n0 0 0\n1 0 0\n0 1 0\n"
MESH = PLY + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@pytest.fixture
def typed(vto, monkeypatch):
    """Call `vto`; returns exit code, document, run folder, stderr."""
    caught = {}

    def note(order, output, overrides, force_all, **_):
        caught.update(data=order.document.data, output=output or order.folder, overrides=overrides, force_all=force_all)
        raise click.exceptions.Exit(0)

    monkeypatch.setattr(results, "run_order", note)
    Path("cloud.ply").write_text(CLOUD)
    Path("mesh.ply").write_text(MESH)

    def call(*arguments):
        caught.clear()
        said = vto(*arguments)
        return said.code, caught, said.err

    return call


def test_scan_finds_out_what_it_got(typed):
    code, caught, err = typed("scan", "cloud.ply", "--role", "garment")
    assert code == 0
    assert "cloud.ply: cloud, because" in err
    assert caught["data"]["given"] == {"garment": {"cloud": "cloud.ply"}}
    assert caught["data"]["want"] == ["garment", "openings", "garment_scan_report", "page"]
    assert caught["output"] == Path("runs/scan_cloud")
    _, caught, _ = typed("scan", "mesh.ply", "--role", "garment", "--mannequin", "form.ply", "-o", "x", "--force-all")
    assert caught["data"]["given"] == {"garment": {"surface": "mesh.ply"}, "mannequin": {"surface": "form.ply"}}
    assert caught["data"]["want"] == ["garment", "openings", "labels", "garment_scan_report", "page"]
    assert (caught["output"], caught["force_all"]) == (Path("x"), True)
    _, caught, _ = typed("scan", "cloud.ply", "--role", "body", "--set", "poisson.depth=7")
    assert caught["data"]["want"] == ["body_surface", "body_scan_report", "page"]
    assert caught["overrides"] == ("poisson.depth=7",)


def test_photos_that_nothing_scales_are_scanned_and_not_cut(typed):
    bare = ["garment_surface", "garment_scan_report", "page"]
    Path("photos").mkdir()
    for name in ("a.jpg", "b.jpg"):
        (Path("photos") / name).write_bytes(b"")
    _, caught, err = typed("scan", "photos", "--role", "garment")
    assert caught["data"]["want"] == bare
    assert "no scale" in err
    ends = ("a.jpg:10,20.5+b.jpg:12,22", "a.jpg:300,20+b.jpg:310,25")
    _, caught, err = typed("scan", "photos", "--role", "garment", "--distance", *ends, "0.42")
    assert caught["data"]["want"] == ["garment", "openings", "garment_texture", "garment_scan_report", "page"]
    first = {"one": {"a.jpg": [10.0, 20.5], "b.jpg": [12.0, 22.0]}, "metres": 0.42}
    assert first.items() <= caught["data"]["stages"]["scale"]["lengths"][0].items()
    assert "no scale" not in err
    assert typed("scan", "photos", "--role", "garment", "--distance", "a.jpg", ends[1], "0.42")[0] == 2
    assert typed("scan", "cloud.ply", "--role", "body", "--distance", *ends, "0.42")[0] == 2
    _, caught, _ = typed("scan", "photos", "--role", "garment", "--mannequin", "form.ply")
    assert "garment" in caught["data"]["want"]


def test_scan_refuses_what_is_no_capture(typed):
    Path("tape.yaml").write_text("measurements: {chest_girth: 96}\n")
    assert typed("scan", "tape.yaml", "--role", "body")[0] == 3
    assert typed("scan", "nothing.ply", "--role", "body")[0] == 3
    assert typed("scan", "cloud.ply")[0] == 2
    assert typed("scan", "cloud.ply", "--role", "body", "--mannequin", "mesh.ply")[0] == 2


def test_fit_takes_one_way_in(typed):
    _, caught, _ = typed("fit", "--measurements", "tape.yaml")
    assert caught["data"]["given"] == {"body": {"measurements": "tape.yaml"}}
    assert caught["data"]["want"] == ["avatar", "measurements", "landmarks", "page"]
    _, caught, _ = typed("fit", "--scan", "mesh.ply")
    assert caught["data"]["given"] == {"body": {"surface": "mesh.ply"}}
    _, caught, _ = typed("fit", "--front", "a.png", "--side", "b.png", "--stature", "1.7")
    assert caught["data"]["given"] == {"body": {"silhouettes": {"front": "a.png", "side": "b.png", "stature": 1.7}}}
    assert typed("fit", "--scan", "mesh.ply", "--sex", "male")[0] == 2  # no toy stage takes it: said, not swallowed
    for arguments in ([], ["--front", "a.png"], ["--scan", "mesh.ply", "--measurements", "tape.yaml"]):
        code, caught, err = typed("fit", *arguments)
        assert (code, caught) == (2, {})
        assert "give one of" in err or "must be given together" in err


def test_drape_takes_avatars_meshes_and_measurements(typed):
    _, caught, _ = typed("drape", "--garment", "g.ply", "--body", "a.npz", "--fabric", "denim")
    assert caught["data"]["given"] == {"garment": {"mesh": "g.ply"}, "body": {"avatar": "a.npz"}, "fabric": "denim"}
    _, caught, _ = typed("drape", "--garment", "g.ply", "--body", "b.ply", "--source-body", "form.ply")
    assert caught["data"]["given"]["body"] == {"mesh": "b.ply"}
    assert caught["data"]["given"]["mannequin"] == {"surface": "form.ply"}
    assert caught["data"]["given"]["fabric"] == "cotton_poplin"
    assert caught["data"]["stages"] == {}
    _, caught, _ = typed("drape", "--garment", "g.ply", "--body", "b.ply", "--source-body", "form.npz", "--regraded")
    assert caught["data"]["given"]["mannequin"] == {"avatar": "form.npz"}
    assert caught["data"]["stages"] == {"grade": {"mode": "regraded"}}
    _, caught, _ = typed("drape", "--garment", "g.ply", "--measurements", "tape.yaml")
    assert caught["data"]["given"]["body"] == {"measurements": "tape.yaml"}
    assert typed("drape", "--garment", "g.ply")[0] == 2
    assert typed("drape", "--garment", "g.ply", "--body", "b.ply", "--measurements", "tape.yaml")[0] == 2
