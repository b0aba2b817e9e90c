"""A form that was never scanned bare: its tape is fitted into the dressed scan, and nothing is aligned to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from vto_pipeline.stages.entry.documents import scan_order
from vto_pipeline.stages.entry.planning import catalogue, planned_document

SAMPLES = Path(__file__).parents[2] / "sample_data"
CLOUD = SAMPLES / "shirt_on_form" / "cloud.ply"


def plan_of(mannequin, tmp_path):
    order = scan_order(CLOUD, "garment", mannequin, [], None, "scan")
    return {step.stage.name: step for step in planned_document(order.document, tmp_path, (), catalogue())[1].steps}


def test_a_tape_stands_in_for_the_form(tmp_path):
    steps = plan_of(SAMPLES / "customer" / "measurements.yaml", tmp_path)
    assert "fit_dressed" in steps
    assert "align" not in steps
    assert "dressed_avatar" in steps["subtract"].inputs
    assert "mannequin_surface" not in {name for step in steps.values() for name in step.inputs}


@pytest.mark.parametrize("mannequin", [SAMPLES / "shirt_on_form" / "form.ply", None])
def test_a_form_that_was_scanned_and_none_at_all_are_as_before(mannequin, tmp_path):
    steps = plan_of(mannequin, tmp_path)
    assert "fit_dressed" not in steps
    assert ("align" in steps) == (mannequin is not None)
    assert "dressed_avatar" not in steps["subtract"].inputs
