"""Which share of a sheet is beyond what its fabric is known to bear: sheets of which a part is drawn or sheared."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from cloth_scenes import sheet

from vto_pipeline.cloth.judge.limits import warn_beyond_limits
from vto_pipeline.cloth.moving.follow import summary
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

COUNT = 21  # points along each side


def known(**limits: float) -> Fabric:
    return read_fabric({"name": "twill", "areal_density_gsm": 100, "membrane": limits})


def judged(moved: np.ndarray, fabric: Fabric, job: Job) -> dict[str, Any]:
    rest = sheet(COUNT, COUNT, 1.0, 1.0)
    found = warn_beyond_limits(TriangleMesh(moved, rest.faces), RestShape(rest.vertices), fabric, job)
    return json.loads(json.dumps(found))


def drawn(rows: int, along: int, factor: float) -> np.ndarray:
    """An upright sheet of a metre, its first rows of squares this much longer, along x (0) or y (1)."""
    points = sheet(COUNT, COUNT, 1.0, 1.0).vertices.copy()
    start = points[:, along].min()
    edge = rows / (COUNT - 1)
    off = points[:, along] - start
    points[:, along] += (factor - 1.0) * np.minimum(off, edge)
    return points


@pytest.mark.parametrize(("along", "thread"), [(1, "warp"), (0, "weft")])
@pytest.mark.parametrize("rows", [5, 8])
def test_the_share_is_that_of_the_rows_that_are_drawn(rows, along, thread):
    """The warp of an upright sheet is the vertical."""
    job = Job()
    found = judged(drawn(rows, along, 1.1), known(elongation_warp=0.09, elongation_weft=0.09, shear_angle_deg=5.0), job)
    expected = {"warp": 0.0, "weft": 0.0, "shear": 0.0} | {thread: rows / (COUNT - 1)}
    assert found["beyond_limits"] == pytest.approx(expected, abs=1e-9)
    assert found["fabric_limits"] == pytest.approx({"warp": 0.09, "weft": 0.09, "shear": np.radians(5.0)})
    (told,) = job.warnings
    assert told == f"beyond what twill is known to bear, 9.0% of {thread}: {rows / (COUNT - 1):.0%} of the cloth"


@pytest.mark.parametrize("limit", [0.101, 0.5])
def test_within_the_limit_nothing_is_beyond_it(limit):
    job = Job()
    found = judged(drawn(9, 1, 1.1), known(elongation_warp=limit, elongation_weft=limit), job)
    assert found["beyond_limits"] == {"warp": 0.0, "weft": 0.0, "shear": None}
    assert not job.warnings
    assert not job.notes


@pytest.mark.parametrize("side", [1, -1])
def test_threads_that_are_sheared_to_either_side(side):
    angle, points = np.radians(20.0), sheet(COUNT, COUNT, 1.0, 1.0).vertices
    x, y, z = points.T
    moved = np.stack([x + side * y * np.sin(angle), y * np.cos(angle), z], axis=1)
    job = Job()
    found = judged(moved, known(elongation_warp=0.05, elongation_weft=0.05, shear_angle_deg=19.0), job)
    assert found["beyond_limits"] == pytest.approx({"warp": 0.0, "weft": 0.0, "shear": 1.0})
    assert job.warnings == ["beyond what twill is known to bear, 19 degrees of shear: 100% of the cloth"]
    assert judged(moved, known(shear_angle_deg=21.0), Job())["beyond_limits"]["shear"] == 0.0


def test_what_is_not_known_is_said_and_not_judged():
    job = Job()
    found = judged(drawn(9, 1, 3.0), known(), job)
    assert found["beyond_limits"] == {"warp": None, "weft": None, "shear": None}
    assert found["fabric_limits"] == {"warp": None, "weft": None, "shear": None}
    assert not job.warnings
    assert "not known" in job.notes[0]


def test_a_motion_is_judged_by_its_worst_frame():
    names = ("body_crossings", "self_crossings", "own_crossings", "yields_mm", "penetration_mm", "max_stretch")
    names += ("max_thread_stretch", "p99_thread_stretch", "max_shear_deg", "seconds", "cpu_seconds")
    shares = ({"warp": 0.1, "weft": None, "shear": 0.0}, {"warp": 0.3, "weft": None, "shear": 0.0})
    records = [dict.fromkeys(names, 0.0) | {"beyond_limits": one} for one in (*shares, shares[0])]
    found = summary(records, known(elongation_warp=0.02, shear_angle_deg=30.0))
    assert found["beyond_limits"] == {"warp": 0.3, "weft": None, "shear": 0.0}
    assert found["fabric_limits"]["warp"] == 0.02
