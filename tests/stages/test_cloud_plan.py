"""A point cloud on the command line, wherever a mesh may stand: it is reconstructed first."""

from __future__ import annotations

from pathlib import Path

from vto_pipeline.stages.entry.documents import Order, drape_order, scan_order
from vto_pipeline.stages.entry.planning import catalogue, planned_document

SAMPLES = Path(__file__).parents[2] / "sample_data"
CLOUD, FORM_CLOUD = SAMPLES / "customer" / "cloud.ply", SAMPLES / "shirt_on_form" / "cloud.ply"
FORM, SHIRT = SAMPLES / "shirt_on_form" / "form.ply", SAMPLES / "shirt_on_form" / "shirt.ply"


def steps(order: Order) -> list[str]:
    return [step.stage.name for step in planned_document(order.document, SAMPLES, (), catalogue())[1].steps]


def test_a_mannequin_may_be_a_cloud() -> None:
    names = steps(scan_order(SHIRT, "garment", FORM_CLOUD, [], None, "a test"))
    assert names.index("mannequin.poisson") < names.index("align")
    assert "mannequin.poisson" not in steps(scan_order(SHIRT, "garment", FORM, [], None, "a test"))


def test_a_body_and_a_source_body_may_be_clouds() -> None:
    names = steps(drape_order([SHIRT], ["denim"], CLOUD, None, FORM_CLOUD, False, "a test"))
    assert names.index("body.poisson") < names.index("fit_scan") < names.index("drape")
    assert "mannequin.poisson" in names
    assert "body.poisson" not in steps(drape_order([SHIRT], ["denim"], FORM, None, FORM, False, "a test"))
