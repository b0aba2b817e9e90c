"""A stature on the command line: which captures it scales, and which have a better scale."""

from __future__ import annotations

from pathlib import Path

import pytest

from vto_pipeline.errors import ConfigError
from vto_pipeline.stages.entry.documents import Order, fit_order, scan_order

SAMPLES = Path(__file__).parents[2] / "sample_data"
PHOTOS, CLOUD = SAMPLES / "shirt_on_form" / "photos", SAMPLES / "customer" / "cloud.ply"
FORM, TAPE = SAMPLES / "shirt_on_form" / "form.ply", SAMPLES / "customer" / "measurements.yaml"


def scale_of(order: Order) -> dict[str, object]:
    stages = order.document.data.get("stages") or {}
    return dict(stages.get("scale", {}))


def test_photos_of_a_body_take_a_stature() -> None:
    assert scale_of(scan_order(PHOTOS, "body", None, [], 1.72, "a test")) == {"stature": 1.72}
    assert scale_of(fit_order(PHOTOS, None, None, None, 1.72, None, "a test")) == {"stature": 1.72}
    assert scale_of(scan_order(PHOTOS, "garment", TAPE, [], 1.72, "a test")) == {"stature": 1.72}


def test_a_form_that_was_scanned_tells_the_scale_better() -> None:
    order = scan_order(PHOTOS, "garment", FORM, [], 1.72, "a test")
    assert scale_of(order) == {}
    assert any("stature is not used" in note for note in order.notes)


def test_a_cloud_has_a_scale() -> None:
    for ask in (
        lambda: scan_order(CLOUD, "body", None, [], 1.72, "a test"),
        lambda: fit_order(CLOUD, None, None, None, 1.72, None, "a test"),
    ):
        with pytest.raises(ConfigError, match="only valid with photos or a video"):
            ask()


def test_outlines_still_need_all_three() -> None:
    with pytest.raises(ConfigError, match="together"):
        fit_order(None, None, PHOTOS, PHOTOS, None, None, "a test")
    with pytest.raises(ConfigError, match="together"):
        fit_order(None, None, None, None, 1.72, None, "a test")
