"""The sample patterns: files as ezdxf reads them, seams, starts without crossings by ipctk; the bench's judges."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import ipctk
import numpy as np
import pytest
from ezdxf import recover
from slow_cases import every

from vto_pipeline.bench.drape.ipc_crossings import crossings
from vto_pipeline.bench.drape.seam_gaps import seam_gaps
from vto_pipeline.bench.samples.patterns.tape import Tape, tape_of
from vto_pipeline.bench.samples.patterns.wardrobe import PATTERNS
from vto_pipeline.cloth.placement.collision_free_start import find_collision_free_start
from vto_pipeline.garment.pattern.embed import in_shape
from vto_pipeline.garment.pattern.figures import panel_figures, seam_figures
from vto_pipeline.garment.pattern.sew import SewConfig, sew
from vto_pipeline.geometry.topology import boundary_loops
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.io.patterns.read import read_pattern
from vto_pipeline.io.patterns.write import SUFFIXES, write_pattern
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

TRUTH = Path(__file__).parents[2] / "sample_data" / "truth"
BODIES = {
    "slim": Tape(1.70, 0.82, 0.64, 0.89),
    "tall": Tape(1.85, 1.00, 0.84, 0.98),
    "large": Tape(1.60, 1.16, 1.04, 1.22),
}
OPENINGS = {"tee": 4, "skirt": 2, "trousers": 3, "shirt": 4, "dress": 4, "jacket": 3}
GATHERED = {"skirt": 0.06, "trousers": 0.06, "shirt": 0.2}  # shares that are eased into bands and cuffs


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("size", every(3, BODIES))
def test_each_is_sewn_closed_and_starts_without_crossings(name, size):
    pattern = PATTERNS[name](BODIES[size])
    sewn = sew(pattern, SewConfig(edge_mm=30.0), Job())
    mesh = in_shape(sewn, Job())
    if name == "shirt":  # sleeves gathered into cuffs by a fifth fold, and the drape untangles them
        start = find_collision_free_start(mesh.vertices, mesh.faces, mesh.vertices, 3e-4, Job())
        mesh = replace(mesh, vertices=start.positions)
    assert not ipctk.has_intersections(
        ipctk.CollisionMesh(mesh.vertices, ipctk.edges(mesh.faces), mesh.faces), np.asfortranarray(mesh.vertices)
    )
    assert len(boundary_loops(mesh)) == OPENINGS[name]
    assert max(seam_gaps(pattern, mesh.texture, mesh.faces, mesh.vertices)) < 1e-3
    assert max(one.share for one in seam_figures(pattern)) == pytest.approx(GATHERED.get(name, 0.0), abs=0.02)


@pytest.mark.parametrize("name", every(3, PATTERNS))
def test_each_comes_back_from_its_files(name, tmp_path):
    pattern = PATTERNS[name](BODIES["tall"])
    for suffix in SUFFIXES:
        write_pattern(tmp_path / f"p{suffix}", pattern)
        back = read_pattern(tmp_path / f"p{suffix}")
        assert back.stitches == pattern.stitches
        for now, was in zip(back.panels, pattern.panels, strict=True):
            assert now.placement.translation == pytest.approx(was.placement.translation, abs=1e-9)
            assert panel_figures(now).area == pytest.approx(panel_figures(was).area, rel=1e-4)
    document, auditor = recover.readfile(tmp_path / "p.dxf")
    assert not auditor.has_errors
    for insert, panel in zip(document.modelspace().query("INSERT"), pattern.panels, strict=True):
        (line,) = document.blocks.get(insert.dxf.name).query('POLYLINE[layer=="1"]')
        x, y = np.array([(v.dxf.location.x, v.dxf.location.y) for v in line.vertices]).T
        area = 0.5e-6 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
        assert area == pytest.approx(panel_figures(panel).area, rel=1e-4)  # curves are flat to a hundredth of a mm


def test_the_tape_of_the_customer_is_its_truth():
    truth = json.loads((TRUTH / "customer_measurements.json").read_text())["measurements"]
    tape = tape_of(read_mesh(TRUTH / "customer_body.ply"))
    assert tape.stature == pytest.approx(truth["stature"], abs=1e-3)
    assert tape.waist == pytest.approx(truth["waist_girth"], abs=0.01)  # levels are a hundredth of the stature apart
    assert tape.hip == pytest.approx(truth["hip_girth"], abs=0.01)
    assert tape.chest == pytest.approx(truth["bust_girth"], abs=0.015)


def test_a_seam_that_comes_apart_is_seen():
    pattern = PATTERNS["skirt"](BODIES["tall"])
    sewn = sew(pattern, SewConfig(edge_mm=30.0), Job())
    mesh = sewn.mesh
    faces = np.arange(3 * len(mesh.faces), dtype=np.int32).reshape(-1, 3)  # no two triangles share a corner
    apart = mesh.vertices[mesh.faces].copy()
    front = sewn.panel == sewn.panels.index("front")
    apart[front] += [0.0, 0.0, 0.004]
    gaps = seam_gaps(pattern, mesh.texture, faces, apart.reshape(-1, 3))
    touched = ["front" in {s.panel for s in (*stitch.first, *stitch.second)} for stitch in pattern.stitches]
    assert np.array(gaps)[touched] == pytest.approx(0.004, abs=1e-4)
    assert max(np.array(gaps)[~np.array(touched)]) < 1e-4


def test_crossings_are_counted():
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    flat = TriangleMesh(square, faces)
    tips = np.array([[0.7, 0.2, -0.5], [0.7, 0.3, 0.5], [0.7, 2.2, 0.5]])
    needle = TriangleMesh(tips, np.array([[0, 1, 2]], np.int32))
    assert crossings(flat, needle) == 3  # two edges of the needle, and the diagonal through it
    assert crossings(flat, replace(needle, vertices=tips + np.array([0.0, 0.0, 0.6]))) == 0
    folded = TriangleMesh(
        np.concatenate([square, needle.vertices]), np.concatenate([faces, needle.faces + 4]).astype(np.int32)
    )
    assert crossings(folded, replace(needle, vertices=tips + 9.0)) == 1
