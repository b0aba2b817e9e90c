"""The drape bench: its judgements on made-up drapes, its cases, and the picture of all kinds of rows."""

import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.drape import budget, left_out, refinement, scanned
from vto_pipeline.bench.drape.case import DrapeCase
from vto_pipeline.bench.drape.garments import drape_row
from vto_pipeline.bench.measures import distance_mm, edge_strain
from vto_pipeline.bench.plots.drape_plot import draw_drape
from vto_pipeline.bench.samples.garments.wearer import wearer
from vto_pipeline.bench.timing import Timing
from vto_pipeline.errors import InputError, IntersectingError
from vto_pipeline.model.cloth import Draped, TraceRow
from vto_pipeline.model.mesh import TriangleMesh

CLEAN = {
    "finite": True,
    "settled": True,
    "body_intersections": 0,
    "self_intersections": 0,
    "max_stretch": 0.01,
    "residual": 0.5,
}


def draped(mesh, predicted_mm, **audit):
    row = TraceRow(1.0, 10, predicted_mm, 0.5)
    return Draped(mesh, np.zeros_like(mesh.vertices), None, (row,), {**CLEAN, **audit})


@pytest.fixture
def shirt(monkeypatch):
    """A drape that moves the garment by its target error along x, but predicts half of that."""
    case = DrapeCase("shirt", "average", "denim", 40.0)

    def drape(self, settings, fabric=None):
        mesh = self.made().mesh
        shift = 1e-3 * settings["target_error_mm"] * np.array([1.0, 0.0, 0.0])
        return draped(TriangleMesh(mesh.vertices + shift, mesh.faces), 0.5 * settings["target_error_mm"])

    monkeypatch.setattr(DrapeCase, "drape", drape)
    budget._reference.cache_clear()
    yield case
    budget._reference.cache_clear()


def test_a_prediction_that_promises_too_much_is_found_out(shirt):
    _, found = budget._measure(shirt, {"target_error_mm": 4.0}, {"target_error_mm": 0.5})
    assert_allclose(found["distance_mm"], 3.5, rtol=1e-9)
    assert_allclose(found["true_over_predicted"], 3.5 / 2.0, rtol=1e-9)
    assert found["honest"] is False
    assert_allclose(found["reference_mm"], 0.25)
    _, near = budget._measure(shirt, {"target_error_mm": 1.0}, {"target_error_mm": 0.5})
    assert near["honest"] is True  # 0.5 mm true, 0.5 mm predicted


def test_a_reference_that_has_not_come_to_rest_judges_nobody(shirt, monkeypatch):
    monkeypatch.setattr(DrapeCase, "drape", lambda self, settings: draped(self.made().mesh, 1.0, settled=False))
    found = budget._measure(shirt, {"target_error_mm": 1.0}, {"target_error_mm": 0.5})[1]
    assert found["distance_mm"] == 0.0
    assert found["honest"] is None


def test_a_failed_drape_is_a_row_too(shirt, monkeypatch):
    def fail(self, settings, fabric=None):
        raise IntersectingError("7 pairs still cross")

    monkeypatch.setattr(DrapeCase, "drape", fail)
    row = Watch().row("shirt", "drape", {}, 0, partial(budget._measure, shirt, {}, {}))
    assert row.errors == {"status": "7 pairs still cross"}


def test_there_are_ten_cases_of_every_garment_and_body():
    cases = [DrapeCase(*names, edge_mm=30.0) for names in budget._CASES]
    assert len({case.name for case in cases}) == 10
    assert {case.garment for case in cases} == {"shirt", "dress", "skirt", "trousers"}
    assert {case.size for case in cases} == {"slim", "average", "large"}
    assert {case.fabric for case in cases} == {"silk_charmeuse", "jersey", "denim", "leather"}


def test_figures_of_a_tube_about_the_body():
    who = wearer("average")
    turn, up = np.meshgrid(2.0 * np.pi * np.arange(64) / 64, np.linspace(0.7, 1.3, 31), indexing="ij")
    radius, axis = 0.35, np.array([0.0, 0.0, who.axis_z])
    points = np.stack([radius * np.sin(turn), up, radius * np.cos(turn)], axis=-1).reshape(-1, 3) + axis
    at = np.arange(64 * 31).reshape(64, 31)
    on = np.roll(at, -1, axis=0)
    a, b, c, d = at[:, :-1].ravel(), on[:, :-1].ravel(), on[:, 1:].ravel(), at[:, 1:].ravel()
    mesh = TriangleMesh(points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))
    found = refinement.figures(mesh, mesh, who)
    assert_allclose(found["hem_mm"], 700.0, rtol=1e-9)
    for zone in ("chest", "waist", "hip"):
        assert_allclose(found[f"{zone}_girth_mm"], 2e3 * np.pi * radius, rtol=2e-3)  # a 64-gon
    assert 50.0 < found["clearance_mm"] < 350.0


def test_strains_are_relative():
    mesh = TriangleMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert_allclose(edge_strain(1.01 * mesh.vertices, mesh.vertices, mesh.faces), 0.01, rtol=1e-9)


def rows():
    settings = {"target_error_mm": 1.0}
    clean = {"predicted_mm": 1.0, "settled": True}
    yield Row("shirt, slim, silk", "reference", settings, 500, 9.0, clean)
    for scene, ratio in (("shirt, slim, silk", 1.2), ("skirt, large, denim", 2.0)):
        for k in (1, 2):
            judged = {"distance_mm": ratio / k, "predicted_mm": 1.0 / k, "honest": ratio < 1.5 if k == 1 else None}
            yield Row(scene, "drape", settings, 500, 1.0 * k, judged)
    for count in (500, 1000, 2000):
        yield Row("refinement", "drape", settings, count, 1.0, {"from_finest_mm": 1e3 / count, "off_hem_mm": 2.0})
    for mode, far in (("as_scanned", 13.0), ("inverse", 0.3)):
        shape = {"from_scan_mm": far, "length_error_median_share": 1e-3 * far}
        yield Row("rest shape: shirt", mode, settings, 500, 1.0, shape)
    for share in (0.2, -0.01):
        yield Row(f"left out: {share}", "default", settings, 500, 1.0, {"saved_share": share, "difference_mm": 0.0})


def test_what_leaving_out_changes_is_seen(shirt, monkeypatch):
    def drape(self, settings, fabric=None, job=None):
        if not job.force_all:
            job.leave_out("strain limits", "the fabric has none")
        mesh, shift = self.made().mesh, [2e-4 * job.force_all, 0.0, 0.0]
        return draped(TriangleMesh(mesh.vertices + shift, mesh.faces), 0.5)

    monkeypatch.setattr(DrapeCase, "drape", drape)
    timing, found = left_out._measure(shirt)
    assert_allclose(found["difference_mm"], 0.2, rtol=1e-9)
    assert_allclose(found["saved_share"], 1.0 - timing.seconds / found["whole_s"], rtol=1e-12)
    assert found["left_out"] == "strain limits"


@pytest.mark.parametrize("kinds", ["every", "one"])
def test_the_picture_has_a_panel_for_each_kind(kinds):
    chosen = list(rows()) if kinds == "every" else [row for row in rows() if "from_scan_mm" in row.errors]
    png = draw_drape({"bench": "drape", "rows": [row.as_json() for row in chosen]})
    assert png.startswith(b"\x89PNG")
    assert len(png) > 20_000


def test_rows_of_nothing_known_are_refused():
    with pytest.raises(InputError, match="none with a figure of a drape"):
        draw_drape({"bench": "drape", "rows": [Row("x", "y", {}, 1, 1.0, {"other": 1.0}).as_json()]})


@pytest.mark.slow
@pytest.mark.parametrize("names", budget._CASES, ids=", ".join)
def test_what_a_drape_promises_is_kept(names):
    """True against predicted error at the end of a run, the truth being the same run continued."""
    case, patient = DrapeCase(*names, edge_mm=25.0), {"settle_seconds": 60.0}
    truth = case.drape({**patient, "target_error_mm": 0.005})
    assert truth.audit["settled"]
    for target in budget.TARGETS_MM:
        found = case.drape({**patient, "target_error_mm": target})
        true = distance_mm(found.mesh.vertices, truth.mesh.vertices)
        assert true <= 1.5 * found.trace[-1].error_mm <= 1.5 * target


@pytest.mark.slow
def test_quick_rows_name_what_they_measure(monkeypatch):
    """No drape here: each measurement is replaced, and what would be measured is looked at."""
    for module in (budget, refinement, scanned, left_out):
        monkeypatch.setattr(module, "_measure", lambda *given: (Timing(1.0), {}))
    monkeypatch.setattr(budget, "_exact", lambda *given: (Timing(1.0), {}))
    parts = (budget.budget_rows, refinement.refinement_rows, scanned.scanned_rows, left_out.drape_left_out_rows)
    found = [row for part in parts for row in part(True, Watch())]
    assert len({row.key for row in found}) == len(found) > 6
    assert all(200 < row.vertices < 3000 for row in found)


def test_a_run_that_takes_too_long_is_a_row(tmp_path):
    began = time.perf_counter()
    row = drape_row(Path("none.obj"), Path("nobody.obj"), "default", tmp_path, [], 0.01)
    assert row["outcome"] == "unfinished"
    assert 0.01 <= row["seconds"] < time.perf_counter() - began + 0.1  # it is rounded
    assert row["crossings"] is row["settled"] is row["vertices"] is None


def test_a_garment_that_is_refused_is_a_row(tmp_path):
    (tmp_path / "none.obj").write_text("")
    row = drape_row(tmp_path / "none.obj", tmp_path / "none.obj", "default", tmp_path, [], 600.0)
    assert row["outcome"] == "refused"
    assert "none.obj" in (tmp_path / "none_on_none.log").read_text()


def test_what_a_failed_run_reached_is_in_its_row(tmp_path):
    (tmp_path / "none_on_nobody" / "out" / "partial").mkdir(parents=True)
    audit = '{"body_intersections": 5, "self_intersections": 2, "settled": false, "residual": 3.0, "max_stretch": 8.2}'
    (tmp_path / "none_on_nobody" / "out" / "partial" / "audit.json").write_text(audit)
    row = drape_row(Path("none.obj"), Path("nobody.obj"), "default", tmp_path, [], 0.01)
    assert (row["crossings"], row["settled"], row["residual"], row["stretch"]) == (7, False, 3.0, 8.2)
