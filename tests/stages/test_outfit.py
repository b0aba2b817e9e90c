"""Several garments in one document: which rows they get, what they are called, and what is wrong with a document."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from vto_pipeline.cli.commands.drape import drape_command
from vto_pipeline.errors import ConfigError, PlanError
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.stages import CATALOGUE
from vto_pipeline.stages.entry.planning import planned
from vto_pipeline.stages.outfit import document_schema, expand_document, garment_names, names_in_run, outfit_tables

HEAD = "schema: 1\n"
GIVEN = """given:
  garments:
    trousers: {mesh: trousers.ply, fabric: denim}
    shirt: {mesh: shirt.ply}
  fabric: jersey
  body: {mesh: body.ply}
"""
WANT = "want: [draped, audit, page]\n"


def written(folder: Path, text: str) -> Path:
    for name in ("trousers.ply", "shirt.ply", "body.ply", "form.ply"):
        (folder / name).write_text("")
    (folder / "outfit.yaml").write_text(text)
    return folder / "outfit.yaml"


def test_the_schema_takes_what_the_engine_takes(tmp_path: Path) -> None:
    check = jsonschema.Draft202012Validator(document_schema(CATALOGUE))
    check.validate(load_yaml(written(tmp_path, HEAD + GIVEN + WANT)).data)
    for change in (("{mesh: shirt.ply}", "{mesh: 3}"), ("    shirt:", "    Shirt!:"), ("mesh: shirt.ply", "mush: a")):
        text = (HEAD + GIVEN + WANT).replace(*change)
        assert not check.is_valid(load_yaml(written(tmp_path, text)).data)


def test_each_garment_has_its_rows_and_one_drape_takes_all(tmp_path: Path) -> None:
    request, plan = planned(written(tmp_path, HEAD + GIVEN + WANT), (), CATALOGUE)
    assert request.want == ("trousers_draped", "shirt_draped", "audit", "page")
    names = [step.stage.name for step in plan.steps]
    for name in ("trousers", "shirt"):
        rows = [f"{name}.{row}" for row in ("take_mesh", "simulation_mesh", "rest_shape", "grade")]
        assert [row for row in names if row.startswith(name)] == rows
    assert names.count("drape") == 1
    drape = next(step for step in plan.steps if step.stage.name == "drape")
    assert drape.inputs == (
        *("trousers_sim_mesh", "trousers_worn_rest", "trousers_fabric"),
        *("shirt_sim_mesh", "shirt_worn_rest", "shirt_fabric", "collider"),
    )
    fabrics = [request.given[f"{name}_fabric"].read(Job()).name for name in ("trousers", "shirt")]
    assert fabrics == ["denim", "cotton jersey"]


def test_all_ride_on_what_they_were_on_and_are_regraded_alike(tmp_path: Path) -> None:
    text = HEAD + GIVEN + "  mannequin: {surface: form.ply}\n" + WANT + "stages: {grade: {mode: regraded}}\n"
    _, plan = planned(written(tmp_path, text), ("simulation_mesh.edge_mm=20",), CATALOGUE)
    steps = {step.stage.name: step for step in plan.steps}
    assert "register_mannequin" in steps
    for name in ("trousers", "shirt"):
        assert steps[f"{name}.grade"].settings.model_dump()["mode"] == "regraded"
        assert steps[f"{name}.simulation_mesh"].settings.model_dump()["edge_mm"] == 20


def test_files_carry_the_name_of_their_garment() -> None:
    tables = outfit_tables(CATALOGUE, ("trousers", "shirt"))
    assert tables.kind("shirt_draped").filename == "shirt_draped.ply"
    assert tables.kind("trousers_fit_report").filename == "trousers_fit_report.json"
    assert tables.kind("audit").filename == "audit.json"
    assert outfit_tables(CATALOGUE, ()) is CATALOGUE
    rows = {"stages": [{"name": stage.name} for stage in tables.stages]}
    assert names_in_run(rows) == ("trousers", "shirt")
    assert names_in_run({"stages": [{"name": stage.name} for stage in CATALOGUE.stages]}) == ()


def test_a_document_with_one_garment_stays_as_it_is(tmp_path: Path) -> None:
    text = HEAD + "given:\n  garment: {mesh: shirt.ply}\n  fabric: jersey\n  body: {mesh: body.ply}\n" + WANT
    document = load_yaml(written(tmp_path, text))
    assert garment_names(document) == ()
    assert expand_document(document, ()) is document


@pytest.mark.parametrize(
    ("change", "line", "problem"),
    [
        (("    shirt:", "    Shirt!:"), 5, "given.garments: 'Shirt!' is not a valid garment name"),
        (("    shirt:", "    body:"), None, "given.garments: body_mesh would be ambiguous"),
        (("  fabric: jersey", "  garment: {mesh: shirt.ply}"), 3, "given.garment and given.garments: give one"),
        (("shirt.ply}", "shirt.ply, fabrik: jersey}"), 5, "given.garments.shirt.fabrik: unknown key (got 'jersey')"),
        (("shirt.ply}", "shirt.ply, fabric: jersy}"), 5, "'jersy' is neither a preset nor a file"),
        (("{mesh: shirt.ply}", "shirt.ply"), 5, "given.garments.shirt: input should be"),
        (("audit, page", "audit, pge"), 8, "want: unknown artifact 'pge'"),
        (("[draped, audit", "[shirt_drapd, audit"), 8, "want: unknown artifact 'shirt_drapd'"),
    ],
)
def test_mistakes_are_located(tmp_path: Path, change: tuple[str, str], line: int | None, problem: str) -> None:
    text = HEAD + GIVEN + WANT
    assert change[0] in text
    with pytest.raises(ConfigError) as caught:
        planned(written(tmp_path, text.replace(*change)), (), CATALOGUE)
    assert problem in caught.value.problem
    assert line is None or caught.value.where.endswith(f"outfit.yaml, line {line}")


@pytest.mark.parametrize("garments", ["[trousers.ply, shirt.ply]", "{}", "trousers.ply"])
def test_garments_without_names_are_refused(tmp_path: Path, garments: str) -> None:
    text = HEAD + f"given:\n  garments: {garments}\n  body: {{mesh: body.ply}}\n" + WANT
    with pytest.raises(ConfigError, match="expected named garments") as caught:
        planned(written(tmp_path, text), (), CATALOGUE)
    assert "inner first" in caught.value.hint


def test_a_garment_without_a_fabric_is_told(tmp_path: Path) -> None:
    with pytest.raises(PlanError) as caught:
        planned(written(tmp_path, HEAD + GIVEN.replace("  fabric: jersey\n", "") + WANT), (), CATALOGUE)
    assert "garments.shirt.fabric" in caught.value.hint


def test_trousers_are_judged_as_trousers_whatever_the_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    for name in ("trousers", "jacket"):
        row = next(s for s in outfit_tables(CATALOGUE, (name,)).stages if s.name == f"{name}.assess")
        monkeypatch.setattr("vto_pipeline.stages.output.assess_fit", lambda *args, **_: seen.append(args[5].garment))
        monkeypatch.setattr("vto_pipeline.stages.output.vertex_maps", lambda *args: {})
        inputs = {f"{name}_draped": None, f"{name}_worn_rest": _Rest(), "collider": _Body(), f"{name}_fabric": None}
        with pytest.raises(TypeError):  # the stand-in judges nothing
            row.run(inputs, row.settings(garment="dress"), Job())
    assert seen == ["trousers", "dress"]


class _Rest:
    positions, worn_as, panels = None, "same_garment", None


class _Body:
    final = None


def test_the_page_shows_all_together_and_judges_each() -> None:
    tables = outfit_tables(CATALOGUE, ("trousers", "shirt"))
    page = next(stage for stage in tables.stages if stage.name == "page")
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    inputs: dict[str, object] = {"run_record": {"stages": [], "seconds": 1.0}}
    for k, name in enumerate(("trousers", "shirt")):
        mesh = TriangleMesh(corner + k, np.array([[0, 1, 2]], np.int32))
        parts = [GlbPart("garment", mesh), GlbPart("body", TriangleMesh(corner - 9.0, mesh.faces))]
        inputs |= {f"{name}_draped": mesh, f"{name}_render_mesh": parts}
        inputs[f"{name}_fit_report"] = report(f"Verdict on {name}.")
    inputs["audit"] = {"settled": True, "layer_intersections": 0, "layers": {"trousers": {"secret": 1}}}
    assert set(inputs) - {"run_record"} <= set(page.optional)
    html = page.run(inputs, page.settings(), Job())["page"]
    for name in ("trousers", "shirt"):
        assert f"Fit of {name}" in html
        assert f"Verdict on {name}." in html
    assert "layer intersections" in html
    assert "secret" not in html
    scene = re.search(r'id="scene"[^>]*>(.*?)</script>', html, re.DOTALL)
    assert scene is not None
    shown = json.loads(scene[1])
    low = {layer["name"]: shown["geometries"][layer["geometry"]]["low"] for layer in shown["layers"]}
    assert (low["Garment"], low["Body"]) == ([0.0, 0.0, 0.0], [-9.0, -9.0, -9.0])  # all wear the same


def report(verdict: str) -> dict[str, object]:
    strain = {"median": 0.01, "p95": 0.02, "max": 0.03, "limit": 0.1, "share_over_limit": 0.0}
    clearance = {"median_mm": 5.0, "min_mm": 3.0, "contact_mm": 4.0, "contact_share": 0.2, "inside_vertices": 0}
    return {"verdict": verdict, "zones": [], "strain": strain, "clearance": clearance, "note": ""}


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--garment", "a/shirt.ply", "--garment", "b/Shirt.obj"], "two garments are named shirt"),
        (["--garment", "a.ply", "--fabric", "denim", "--fabric", "jersey"], "2 fabrics for 1 garments"),
    ],
)
def test_what_a_command_line_gives_twice_or_too_often(
    arguments: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from vto_pipeline.cli.main import main

    assert main(["drape", *arguments, "--body", "b.ply"]) == 2
    assert problem in capsys.readouterr().err


def test_one_fabric_serves_all_garments_of_a_command_line(monkeypatch: pytest.MonkeyPatch) -> None:
    from click.testing import CliRunner

    asked = []
    monkeypatch.setattr("vto_pipeline.cli.results.perform", lambda _, order, **__: asked.append(order.document.data))
    line = ["--garment", "My-trousers.ply", "--garment", "shirt.ply", "--fabric", "denim", "--body", "b.ply"]
    assert CliRunner().invoke(drape_command, line).exit_code == 0
    assert asked[0]["given"]["garments"] == {
        "my_trousers": {"mesh": "My-trousers.ply", "fabric": "denim"},
        "shirt": {"mesh": "shirt.ply", "fabric": "denim"},
    }
    assert_array_equal(list(asked[0]["given"]["garments"]), ["my_trousers", "shirt"])
