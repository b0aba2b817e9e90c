"""Extreme fabrics worn, in the stability bench: how they are made, and what is said of made-up drapes of them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.bench import Watch
from vto_pipeline.bench.drape.case import DrapeCase
from vto_pipeline.bench.stability import worn
from vto_pipeline.bench.timing import Timing
from vto_pipeline.errors import IntersectingError
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.cloth import Draped
from vto_pipeline.model.mesh import TriangleMesh

SHIRT = DrapeCase("shirt", "average", "denim", 40.0)
CLEAN = {
    "finite": True,
    "settled": True,
    "body_intersections": 0,
    "self_intersections": 0,
    "max_stretch": 0.01,
    "residual": 0.5,
}


def draped(**audit):
    mesh = TriangleMesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    return Draped(mesh, np.zeros_like(mesh.vertices), None, (), {**CLEAN, **audit})


@pytest.mark.parametrize(
    ("audit", "word"),
    [
        ({}, "passes"),
        ({"settled": False}, "moves"),
        ({"self_intersections": 1}, "crossings"),
        ({"body_intersections": 2, "settled": False}, "crossings"),
        ({"finite": False, "self_intersections": 3}, "not finite"),
    ],
)
def test_the_worst_is_the_verdict(monkeypatch, audit, word):
    monkeypatch.setattr(DrapeCase, "drape", lambda self, settings, fabric=None: draped(**audit))
    assert worn._measure(SHIRT, read_fabric("denim"), {})[1]["verdict"] == word


def test_a_fabric_is_changed_in_one_way_only():
    base = read_fabric("cotton_poplin")
    soft = worn.extreme(base, "stretch", 1e-3)
    assert_allclose([soft.stretch_warp, soft.stretch_weft, soft.shear], 1e-3 * np.array(
        [base.stretch_warp, base.stretch_weft, base.shear]), rtol=1e-12)  # fmt: skip
    assert replace(soft, stretch_warp=base.stretch_warp, stretch_weft=base.stretch_weft, shear=base.shear) == base
    assert worn.extreme(base, "density", 2000.0).areal_density == 2.0
    assert worn.extreme(base, "friction", 2.0).friction == 2.0
    assert_allclose(worn.extreme(base, "bending", 1e3).bending_weft, 1e3 * base.bending_weft, rtol=1e-12)


def test_a_failed_drape_is_a_row_too(monkeypatch):
    def fail(self, settings, fabric=None):
        raise IntersectingError("7 pairs still cross")

    monkeypatch.setattr(DrapeCase, "drape", fail)
    assert worn._measure(SHIRT, read_fabric("denim"), {})[1]["verdict"] == "IntersectingError"


def test_rows_name_what_they_measure(monkeypatch):
    """No drape here: the measurement is replaced, and what would be measured is looked at."""
    monkeypatch.setattr(worn, "_measure", lambda *given: (Timing(1.0), {"verdict": "passes"}))
    found = list(worn.worn_rows(False, "default", Watch()))
    assert len({row.key for row in found}) == len(found) == sum(len(values) for values in worn.EXTREMES.values())
    for what, least, most in (
        ("stretch", 1e-3, 1e4),
        ("bending", 1e-4, 1e3),
        ("density", 20, 2000),
        ("friction", 0, 2),
    ):
        assert {f"worn, {what} {least:g}", f"worn, {what} {most:g}"} <= {row.scene for row in found}


@pytest.mark.slow
@pytest.mark.parametrize(("what", "value"), [(what, value) for what in worn.EXTREMES for value in worn.EXTREMES[what]])
def test_extreme_fabrics_end_finite_and_clean(what, value):
    base = read_fabric("cotton_poplin")
    case = DrapeCase("shirt", "average", base.name, 40.0)
    found = case.drape({"target_error_mm": 2.0}, worn.extreme(base, what, value))
    assert np.isfinite(found.mesh.vertices).all()
    assert found.audit["finite"] is True
    assert found.audit["body_intersections"] == found.audit["self_intersections"] == 0
    assert found.audit["penetration_mm"] == 0.0
