"""Bodies of children: head, legs and build as surveys of children have them, and no lumps."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measuring.avatar_measurements import measure_avatar
from vto_pipeline.avatar.measuring.growth import resized, size_share
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job

MEDIANS = {  # stature, girth of the head [m] and mass [kg] of both sexes' medians: WHO 2006, 2007; Nellhaus 1968
    4: (1.03, 0.500, 16.2),
    6: (1.155, 0.515, 20.3),
    10: (1.38, 0.533, 31.5),
}


def child(stature: float, sex: str = "neutral", **more: float) -> Avatar:
    return fit_measurements(Measurements({"stature": stature, **more}, sex=sex), job=Job())


@pytest.mark.parametrize("years", MEDIANS)
@pytest.mark.parametrize("sex", ["female", "male"])
def test_of_their_stature_alone_children_have_a_childs_head_and_mass(years: int, sex: str) -> None:
    stature, head, mass = MEDIANS[years]
    found = measure_avatar(child(stature, sex)).values
    assert found["stature"] == pytest.approx(stature, abs=5e-4)
    assert found["head_girth"] == pytest.approx(head, abs=0.025)
    assert found["mass"] == pytest.approx(mass, rel=0.12)


def profile(body: Avatar) -> np.ndarray:
    """Girths of the left leg from ankle to crotch in steps of 2 % of the stature, by sections of trimesh [m]."""
    mesh = trimesh.Trimesh(body.bind_vertices, body.faces, process=False)
    low, high = (body.bind_vertices[body.loops[f"left_{row}"], 1].mean() for row in ("ankle", "thigh"))
    girths = []
    for y in np.arange(low, high, 0.02 * np.ptp(body.bind_vertices[:, 1])):
        curves = mesh.section([0.0, 1.0, 0.0], [0.0, y + 1e-5, 0.0]).discrete
        curve = next(c for c in curves if 0.02 < c[:, 0].mean() < 0.2 and c[:, 2].max() < 0.2)
        girths.append(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())
    return np.array(girths)


@pytest.mark.parametrize("tape", [{"mass": 35.0}, {"mass": 22.0}, {}])
def test_a_child_is_not_lumpy(tape: dict[str, float]) -> None:
    """Up a leg, girth rises to the calf, falls to the knee and rises again: it turns twice, as an adult's does."""
    for body in (child(1.20, **tape), fit_measurements(Measurements({"stature": 1.70}, sex="neutral"))):
        step = np.diff(profile(body)) / np.ptp(body.bind_vertices[:, 1])
        sense = np.sign(step[np.abs(step) > 1e-3])
        assert (np.diff(sense) != 0).sum() == 2
        assert len(self_intersections(body.mesh)) == 0


def test_what_is_given_is_met_whatever_the_size() -> None:
    tape = {"stature": 1.10, "chest_girth": 0.58, "waist_girth": 0.54, "hip_girth": 0.60, "inside_leg": 0.49}
    found = measure_avatar(child(tape["stature"], **{k: v for k, v in tape.items() if k != "stature"})).values
    for name, value in tape.items():
        assert found[name] == pytest.approx(value, abs=2e-3), name


def test_whom_the_survey_knows_is_not_resized() -> None:
    """Three spreads below the mean woman (1.628 m, 0.064 m: ANSUR II) begins what it does not know."""
    women = population("female")
    assert size_share(None, women) == size_share(1.45, women) == 1.0
    assert size_share(1.0, women) == pytest.approx(1.0 / (1.6285 - 3 * 0.0642), rel=1e-3)


def test_of_the_same_shape_mass_grows_as_the_cube() -> None:
    assert resized({"stature": 1.0, "mass": 20.0}, 2.0) == {"stature": 2.0, "mass": 160.0}
