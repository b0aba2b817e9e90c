"""The fit report on tubes whose ease is chosen."""

from __future__ import annotations

import json

import numpy as np
import pytest
from assess_shapes import tube
from numpy.testing import assert_allclose

from vto_pipeline.assess.fit import FitConfig, assess_fit
from vto_pipeline.errors import ConfigError
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

POPLIN = Fabric("poplin", 0.12, 3e-4, 1500, 1200, 60, 0.2, 1.1e-5, 0.9e-5, 1e-3, 0.3)
BODY = tube(0.15, 0.15, 0.0, 1.8)


def report(ease_m: float, scale_rest: float = 1.0, job: Job | None = None, **settings):
    radius = 0.15 + ease_m / (2 * np.pi)
    garment = tube(radius, radius, 0.8, 1.5)
    rest = garment.vertices * [scale_rest, 1.0, scale_rest]
    config = FitConfig(**settings)
    return assess_fit(garment, rest, BODY, {"chest": 1.2, "neck": 1.6}, POPLIN, config, job or Job())


def chest(ease_m: float, **more) -> dict:
    return next(z for z in report(ease_m, **more)[0]["zones"] if z["zone"] == "chest")


@pytest.mark.parametrize(("ease_m", "verdict"), [(0.02, "tight"), (0.06, "good"), (0.12, "loose")])
def test_verdict_follows_the_allowance(ease_m: float, verdict: str) -> None:
    zone = chest(ease_m)
    assert zone["verdict"] == verdict
    assert_allclose(zone["ease_m"], ease_m, rtol=1e-3, err_msg="256-gon")
    assert zone["allowance_m"] == [0.038, 0.076]


def test_cloth_shorter_than_the_body_is_stretched() -> None:
    assert chest(0.01, scale_rest=0.9)["verdict"] == "stretched"


@pytest.mark.parametrize(("scale_rest", "verdict"), [(0.6, "stretched"), (0.9, "stretched"), (0.97, "good")])
def test_cloth_with_a_gap_is_stretched_as_well(scale_rest: float, verdict: str) -> None:
    """A tube with 6 cm of ease and a gap of 30 degrees, as where sleeves go off: 0.92 m of cloth.

    Less than 6 cm of that may be stretch: 10 % of it is more, 3 % is less.
    """
    radius = 0.15 + 0.06 / (2 * np.pi)
    garment = tube(radius, radius, 0.8, 1.5)
    middle = garment.vertices[garment.faces].mean(axis=1)
    gap = np.abs(np.arctan2(middle[:, 0], middle[:, 2])) < np.deg2rad(15)
    rest = garment.vertices * [scale_rest, 1.0, scale_rest]
    opened = TriangleMesh(garment.vertices, garment.faces[~gap])
    found, _ = assess_fit(opened, rest, BODY, {"chest": 1.2}, POPLIN, FitConfig(), Job())
    zone = next(z for z in found["zones"] if z["zone"] == "chest")
    assert not zone["closed"]
    assert_allclose(zone["ease_m"], 0.06, atol=2e-3, rtol=0, err_msg="a chord over the gap is shorter than its arc")
    assert zone["verdict"] == verdict


def test_settings_override_the_table() -> None:
    assert chest(0.06, allowances_cm={"chest": (10, 12)})["verdict"] == "tight"


def test_report_is_plain_json_and_says_what_it_left_out() -> None:
    job = Job()
    found, maps = report(0.06, job=job)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert job.left_out == [("ease at the neck", "the garment does not go around the body there")]
    assert_allclose(maps["clearance_mm"], 60 / (2 * np.pi), rtol=0.02, err_msg="256-gon against 256-gon")
    assert_allclose(maps["stretch"], 1.0, rtol=1e-9, err_msg="the rest shape is the shape")


def test_trunk_mask_takes_the_arms_away() -> None:
    radius = 0.15 + 0.06 / (2 * np.pi)
    garment = tube(radius, radius, 0.8, 1.5)
    trunk = np.abs(BODY.vertices[:, 0]) < 0.12
    found, _ = assess_fit(garment, garment.vertices, BODY, {"chest": 1.2}, POPLIN, FitConfig(), Job(), trunk=trunk)
    zone = next(z for z in found["zones"] if z["zone"] == "chest")
    assert not zone["closed"]
    assert 0 < zone["body_girth_m"] < 2 * np.pi * 0.15


def test_unknown_garment_is_refused() -> None:
    with pytest.raises(ConfigError, match="unknown kind"):
        report(0.06, garment="shrit")
