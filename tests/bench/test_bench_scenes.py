"""Scenes and measures against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.cloth.scenes import AREAL_DENSITY, RADIUS, Scene, hang, measures, shirt, sphere
from vto_pipeline.bench.measures import distance_mm
from vto_pipeline.cloth.model.build import ClothState, at_rest
from vto_pipeline.geometry.topology import boundary_loops, edges
from vto_pipeline.model.mesh import TriangleMesh

ROUNDING = 1e-12  # relative, of a sum over some hundred terms of order one


def measured(scene: Scene, positions: np.ndarray, velocities: np.ndarray | None = None) -> dict[str, float]:
    still = np.zeros_like(positions) if velocities is None else velocities
    return measures(scene, ClothState(positions, still))


@pytest.mark.parametrize("make", [hang, sphere])
def test_a_square_metre_with_alternating_diagonals(make):
    scene = make(9)
    rest = TriangleMesh(scene.rest, scene.model.faces)
    lengths = np.linalg.norm(np.diff(scene.rest[edges(rest)], axis=1)[:, 0], axis=1)
    sides, diagonals = lengths < 1.2 / 8, lengths > 1.2 / 8
    assert (sides.sum(), diagonals.sum()) == (2 * 8 * 9, 64)
    assert_allclose(lengths[sides], 1 / 8, rtol=ROUNDING)
    assert_allclose(lengths[diagonals], np.sqrt(2) / 8, rtol=ROUNDING)
    valence = np.bincount(edges(rest)[diagonals].ravel(), minlength=81)
    inner = valence.reshape(9, 9)[1:-1, 1:-1]
    assert set(inner.ravel()) == {0, 4}  # every other vertex has all four diagonals: no direction is preferred
    assert_allclose(scene.model.mass.sum(), AREAL_DENSITY, rtol=ROUNDING)
    assert len(boundary_loops(rest)) == 1


def test_hung_by_two_corners_with_a_bump_of_a_millimetre():
    scene = hang(9)
    held = np.flatnonzero(scene.model.inverse_mass == 0.0)
    assert_allclose(scene.start[held], [[-0.5, 1, 0], [0.5, 1, 0]], atol=1e-15)  # sine of π, rounded
    assert_allclose(scene.start[:, 2].max(), 1e-3, rtol=ROUNDING)
    assert_allclose(np.abs(scene.start - scene.rest).max(), 1e-3, rtol=ROUNDING)
    assert scene.model.gravity @ [0, 1, 0] == pytest.approx(-9.81, rel=1e-3)  # standard gravity


def test_a_stretched_sheet():
    scene = hang(5)
    found = measured(scene, scene.rest * [1.01, 1.02, 1.0])
    # of 56 edges 20 run across, 20 along and 16 at 45°, which grow by the root of the mean square
    across, along, slanted = 0.01, 0.02, np.sqrt((1.01**2 + 1.02**2) / 2) - 1
    rms = np.sqrt((20 * across**2 + 20 * along**2 + 16 * slanted**2) / 56)
    assert found["rms_stretch"] == pytest.approx(rms, rel=1e-10)  # differences of lengths near one
    assert found["max_stretch"] == pytest.approx(along, rel=1e-10)
    assert found["mean_height_m"] == pytest.approx(0.51, rel=ROUNDING)


def test_kinetic_energy_leaves_the_held_corners_out():
    scene = hang(5)
    free = scene.model.mass[scene.model.inverse_mass > 0].sum()
    found = measured(scene, scene.rest, np.full_like(scene.rest, 2.0))
    assert found["kinetic_j"] == pytest.approx(0.5 * free * 12.0, rel=ROUNDING)


def test_a_sheet_through_the_ball():
    scene = sphere(6)  # no vertex on the axis: the middle of the surface is the deepest point
    level = scene.rest * [1, 0, 1]
    found = measured(scene, level + np.array([0, 0.25, 0]))
    assert found["penetration_mm"] == pytest.approx(50.0, rel=1e-9)
    nearest = np.sqrt(0.25**2 + 2 * 0.1**2)  # the four vertices about the middle
    assert found["vertex_penetration_mm"] == pytest.approx(1e3 * (RADIUS - nearest), rel=1e-9)
    assert found["self_crossings"] == 0
    outside = measured(scene, level + np.array([0, 0.31, 0]))
    assert (outside["penetration_mm"], outside["vertex_penetration_mm"]) == (0.0, 0.0)


def test_a_folded_sheet_crosses_itself():
    scene = sphere(6)
    tilted = scene.rest.copy()
    second = tilted[:, 0] > 0.0
    tilted[second] = tilted[second] * [-1, 1, 1] + [0.05, 0, 0]
    tilted[second, 1] = RADIUS + 0.05 + 0.1 * np.sign(tilted[second, 2])
    assert measured(scene, tilted)["self_crossings"] > 0


def test_distance_is_rms_in_millimetres():
    one = np.zeros((4, 3))
    other = one.copy()
    other[0] = [0.003, 0.004, 0.0]
    assert distance_mm(one, other) == pytest.approx(5.0 / 2.0, rel=ROUNDING)


@pytest.mark.slow
def test_the_shirt_stands_on_its_form():
    scene = shirt(40.0)
    mesh = TriangleMesh(scene.start, scene.model.faces)
    assert len(boundary_loops(mesh)) == 4  # neck, hem, two cuffs
    assert 300 < len(scene.start) < 1500
    assert measured(scene, scene.start)["max_stretch"] == 0.0
    assert scene.damping > 0.0


def test_stiffness_is_a_parameter():
    soft, stiff = (hang(5, stiffness) for stiffness in (1e3, 1e5))
    start = soft.rest * [1.01, 1.0, 1.0]
    from vto_pipeline.cloth.dynamics.residual import elastic_energy

    ratio = elastic_energy(stiff.model, start) / elastic_energy(soft.model, start)
    assert ratio == pytest.approx(100.0, rel=1e-9)
    # plane stress, strain in one direction only: ½ E ε² / (1 - ν²) per square metre
    assert elastic_energy(soft.model, start) == pytest.approx(0.5 * 1e3 * 1e-4 / (1 - 0.09), rel=1e-9)


def test_measures_take_the_scene_as_it_is():
    scene = hang(5)
    assert "penetration_mm" not in measures(scene, at_rest(scene.start))
    assert "penetration_mm" in measures(replace(scene, ball=(0.0, 9.0, 0.0)), at_rest(scene.start))
