"""Threads that are softer on the way to rest, and as stiff as they are where they are tight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from test_drape import pear, vest

from vto_pipeline.cloth.drape import drape as cloth_drape
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.rest import multiresolution
from vto_pipeline.cloth.rest.softened import softened
from vto_pipeline.io.documents import read_json
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.fabric import StretchCurve
from vto_pipeline.model.garment import RestShape
from vto_pipeline.stages.entry.commands import drape

DATA = Path(__file__).parents[3] / "shared" / "data"
SKIRT, WOMAN = DATA / "garments/berkeley/skirt/skirt-iso.obj", DATA / "bodies/mh_female_averageweight.ply"
WIDTH, HEIGHT = 0.2, 0.3  # m
STIFF = 1000.0  # N/m


def energy(deform, config=None, made_of=None):
    """Energy of a sheet of softer threads after a deformation, per area [J/m²]."""
    mesh = sheet(5, 7, WIDTH, HEIGHT)
    cloth, settings = softened(made_of or fabric(stretch=STIFF), config or DrapeConfig())
    model = build_cloth(mesh, RestShape(mesh.vertices), cloth, materials=settings)
    return elastic_energy(model, mesh.vertices @ np.asarray(deform).T) / (WIDTH * HEIGHT)


def stretched(strain, axis):
    made = np.eye(3)
    made[axis, axis] += strain
    return made


def expected(strain, knee=0.005, stiffer=STIFF):
    """Integral of a tension of slope STIFF / 10, and from the knee on of the fabric's own."""
    beyond = max(strain - knee, 0.0)
    return 0.5 * 0.1 * STIFF * strain**2 + 0.5 * (stiffer - 0.1 * STIFF) * beyond**2


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("strain", [0.002, 0.005, 0.02, 0.1])
def test_a_tenth_up_to_half_a_percent_and_the_fabrics_own_beyond(strain, axis):
    assert energy(stretched(strain, axis)) == pytest.approx(expected(strain), rel=1e-9)


def test_a_limit_that_was_set_keeps_its_stiffness():
    tight = DrapeConfig(strain_limit=0.003, beyond_limit=30.0)
    assert energy(stretched(0.02, 0), tight) == pytest.approx(expected(0.02, 0.003, 31.0 * STIFF), rel=1e-9)
    wide = DrapeConfig(strain_limit=0.3, beyond_limit=30.0)
    assert energy(stretched(0.02, 0), wide) == pytest.approx(expected(0.02), rel=1e-9)


def test_measured_curves_are_softer_by_as_much():
    curve = StretchCurve((0.0, 0.1), (0.0, 0.1 * STIFF))
    measured = replace(fabric(stretch=STIFF), curve_warp=curve, curve_weft=curve)
    found = energy(stretched(0.02, 0), DrapeConfig(membrane="curve"), measured)
    assert found == pytest.approx(expected(0.02), rel=1e-9)


def test_shear_and_fabric_stay_as_they_are():
    given = fabric(stretch=STIFF)
    soft, _ = softened(given, DrapeConfig())
    assert replace(soft, stretch_warp=STIFF, stretch_weft=STIFF) == given


def settlings(monkeypatch, jams=False):
    """When each settling of a vest began, on a body that grows under it [s], and when the body had grown.

    And the forces of its contacts as it knew them at its begin, and at its end [N].
    """
    settle, began = multiresolution.Phases.settle, []

    def noted(self, state, stepper, *rest):
        known = stepper.contact_memory.force
        found = settle(self, state, stepper, *rest)
        found.jammed = jams
        began.append((state.time, stepper._colliders[0].ends, known, stepper.contact_memory.force))
        return found

    monkeypatch.setattr(multiresolution.Phases, "settle", noted)
    body = MovingBody(np.stack([pear().vertices, 1.05 * pear().vertices]), pear().faces)
    cloth_drape(vest(), body, fabric(bending=1e-5), {"settle_seconds": 0.1})
    return began


def test_the_body_does_not_move_again_for_the_cloth_as_it_is(monkeypatch):
    (soft, ends, *_), (own, *_), *_ = settlings(monkeypatch)
    assert ends > 0.01
    assert own >= soft >= ends - 1e-9


def test_contacts_are_known_when_it_goes_on_as_it_is(monkeypatch):
    (*_, left), (_, _, known, _), *_ = settlings(monkeypatch)
    assert (left > 0.0).sum() > 10
    np.testing.assert_array_equal(known, left)


def test_what_jams_with_softer_threads_is_not_tried_as_it_is(monkeypatch):
    assert len(settlings(monkeypatch, jams=True)) == 1


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not SKIRT.exists(), reason="the shared data is not here")
def test_a_real_skirt_comes_to_rest_in_fewer_steps_and_lies_no_worse(monkeypatch, tmp_path):
    found = {}
    for name, soften in (("soft", softened), ("direct", lambda fabric, config: (fabric, config))):
        monkeypatch.setattr(multiresolution, "softened", soften)
        drape(garment=SKIRT, body=WOMAN, output=tmp_path / name)
        stages = read_json(tmp_path / name / "run.json")["stages"]
        found[name] = next(stage["metrics"] for stage in stages if stage["name"] == "drape")
    soft, direct = found["soft"], found["direct"]
    assert soft["settled"] is True
    assert soft["body_intersections"] == soft["self_intersections"] == 0
    assert soft["energy_j"] < 1.02 * direct["energy_j"]  # 6 % less, measured
    assert soft["steps"] < 0.8 * direct["steps"]
