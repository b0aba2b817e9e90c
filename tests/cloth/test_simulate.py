"""Cloth in motion against closed forms."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline import cloth
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.model.mesh import TriangleMesh

G = 9.80665


def test_free_fall():
    mesh = sheet(5, 5, 0.2, 0.2)
    found = cloth.simulate(mesh, fabric(), seconds=0.5, settings={"substeps": 20})
    steps, h = 600, 1 / 1200
    drop = G * h * h * steps * (steps + 1) / 2  # symplectic Euler, exactly
    assert_allclose(found.positions - mesh.vertices, np.broadcast_to([0, -drop, 0], mesh.vertices.shape), atol=1e-11)
    assert_allclose(found.velocities[:, 1], -G * 0.5, rtol=1e-9)
    assert found.report["steps"] == steps


def test_one_spring_is_implicit_euler():
    """A triangle held at two corners is a spring of stiffness Y A g² along its height; one sweep solves it exactly."""
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.05, -0.2, 0.0]])
    stiffness, density, h = 80.0, 0.3, 1 / 240
    start = points.copy()
    start[2, 1] = -0.26
    found = cloth.simulate(
        TriangleMesh(start, [[0, 2, 1]]),
        fabric(stretch=stiffness, density=density),
        rest=points,
        pinned=[0, 1],
        seconds=0.05,
        settings={"solver": "xpbd", "substeps": 4, "gravity": (0, 0, 0)},
    )
    area = 0.01
    k, mass = stiffness * area / 0.2**2, density * area / 3
    stretch, speed = 0.06, 0.0
    for _ in range(12):
        speed = (speed - h * k / mass * stretch) / (1 + h * h * k / mass)
        stretch += h * speed
    assert abs(stretch) > 1e-3
    assert_allclose(found.positions[2], [0.05, -0.2 - stretch, 0], rtol=0, atol=1e-10)  # rounding over 12 steps
    assert_allclose(found.velocities[2, 1], -speed, rtol=0, atol=1e-8)


def test_a_hanging_strip_stretches_by_its_weight():
    length, stiffness, density = 0.5, 60.0, 0.2
    mesh = sheet(4, 21, 0.075, length)
    found = cloth.simulate(
        mesh,
        fabric(stretch=stiffness, shear=60.0, density=density),
        pinned=[0, 1, 2, 3],
        seconds=10.0,
        settings={"until": "rest", "target_error_mm": 0.02, "damping": 8.0, "substeps": 40},
    )
    assert found.report["settled"]
    bottom = found.positions[-4:, 1].mean() + length
    assert_allclose(bottom, -density * G * length**2 / (2 * stiffness), rtol=0.01)  # 0.02 mm asked of 4.1 mm


def test_same_bits_on_one_and_two_threads():
    mesh = sheet(51, 51, 0.6, 0.6, upright=False)
    assert len(mesh.vertices) > PARALLEL_FROM
    ball = cloth.Sphere((0.3, -0.25, 0.3), 0.2)
    found = [
        cloth.simulate(
            mesh, fabric(bending=1e-5), colliders=[ball], seconds=0.2, settings={"threads": threads, "substeps": 4}
        )
        for threads in (1, 2)
    ]
    assert np.abs(found[0].positions - mesh.vertices).max() > 0.1
    assert_array_equal(found[0].positions, found[1].positions)
    assert_array_equal(found[0].velocities, found[1].velocities)


@pytest.mark.parametrize("case", ["stiff", "heavy", "flattened", "scattered", "point"])
def test_extreme_starts_stay_finite_and_bounded(case):
    mesh = sheet(12, 12, 0.3, 0.3)
    start, stuff = mesh.vertices.copy(), fabric(bending=1e-5)
    rng = np.random.default_rng(0)
    if case == "stiff":
        stuff = fabric(stretch=9e8, shear=9e8, bending=1e-5)
    elif case == "heavy":
        stuff = fabric(density=200.0, stretch=9e8, shear=9e8)
    elif case == "flattened":
        start[:, 1] *= 1e-3
    elif case == "scattered":
        start = rng.normal(size=start.shape)
        start *= 0.3 / np.linalg.norm(start, axis=1, keepdims=True)
    else:
        start = rng.normal(0, 1e-9, start.shape)
    found = cloth.simulate(
        TriangleMesh(start, mesh.faces),
        stuff,
        rest=mesh.vertices,
        pinned=[0, 11],
        seconds=2.0,
        settings={"damping": 2.0},
    )
    held = np.linalg.norm(start[0] - start[11])
    assert np.abs(found.positions).max() < 2.0
    assert np.abs(found.velocities).max() < 5.0
    if 0.2 < held < 0.4:  # its corners can be as far apart as they were made
        length = np.linalg.norm(found.positions[143] - found.positions[132])
        assert 0.15 < length < 0.45


def test_a_falling_sheet_comes_to_its_terminal_speed_in_air():
    mesh = sheet(5, 4, 0.2, 0.15, upright=False)
    settings = {"solver": "backward_euler", "air_drag": 1.2, "air_density": 1.3}
    found = cloth.simulate(mesh, fabric(density=0.15), seconds=3.0, settings=settings)
    terminal = np.sqrt(2.0 * 0.15 * G / (1.3 * 1.2))  # weight = ½ρ c v², per area
    assert_allclose(found.velocities[:, 1].mean(), -terminal, rtol=1e-6)  # tanh(g t / v) is 1 to 1e-16
    with pytest.raises(ConfigError, match="air_drag is set, and solver 'xpbd' knows no forces"):
        cloth.simulate(mesh, fabric(), seconds=0.1, settings={"solver": "xpbd", "air_drag": 1.0})


# relative errors: of balance to rounding, or of what is still to come after the 1 µm of 336 that is asked for
GIVING_WAY = {"newton": 1e-9, "backward_euler": 1e-9, "imex": 1e-9, "projective": 1e-6, "gauss_seidel": 1e-6}
GIVING_WAY |= {"xpbd": 1e-4, "verlet": 1e-3, "rk4": 1e-3}


@pytest.mark.parametrize("solver", GIVING_WAY)
def test_pins_that_give_way_sink_by_the_weight_they_bear(solver):
    mesh, compliance, pinned = sheet(7, 5, 0.3, 0.2), 2e-2, list(range(7))
    settings = {"until": "rest", "target_error_mm": 1e-3, "damping": 20.0, "pin_compliance": compliance}
    stuff = fabric(density=0.2, bending=1e-5)
    found = cloth.simulate(mesh, stuff, pinned=pinned, seconds=20.0, settings={**settings, "solver": solver})
    assert found.report["settled"]
    moved = (found.positions - mesh.vertices)[pinned]
    weight = 0.2 * 0.3 * 0.2 * G
    assert_allclose(-moved[:, 1].sum(), compliance * weight, rtol=GIVING_WAY[solver])
    assert_allclose(moved.sum(axis=0)[[0, 2]], 0.0, rtol=0, atol=compliance * weight * GIVING_WAY[solver])


def test_what_hangs_on_a_pin_that_gives_way_is_held_and_what_lies_beside_it_falls():
    one = sheet(4, 3, 0.1, 0.1)
    beside = one.vertices + np.array([1.0, 0.0, 0.0])
    both = TriangleMesh(np.vstack([one.vertices, beside]), np.vstack([one.faces, one.faces + 12]))
    settings = {"solver": "newton", "damping": 0.0, "pin_compliance": 1e-3}
    found = cloth.simulate(both, fabric(), pinned=range(4), seconds=0.5, settings=settings)
    steps, h = 30, 1 / 60
    assert_allclose((both.vertices - found.positions)[12:, 1], G * h * h * steps * (steps + 1) / 2, rtol=1e-9)
    assert np.abs(found.positions - both.vertices)[:12].max() < 0.02


def test_pins_that_give_way_are_pins_at_rest():
    mesh, settings = sheet(7, 5, 0.3, 0.2), {"pin_compliance": 2e-2}
    with pytest.raises(InputError, match="pinned vertex 99"):
        cloth.simulate(mesh, fabric(), pinned=[99], seconds=0.1, settings=settings)
    with pytest.raises(ConfigError, match="pins on a path"):
        cloth.simulate(
            mesh, fabric(), pinned=[0], pin_path=lambda t: mesh.vertices[[0]], seconds=0.1, settings=settings
        )


def test_unknown_settings_are_refused():
    with pytest.raises(ConfigError, match="substep"):
        cloth.simulate(sheet(3, 3, 1, 1), fabric(), seconds=1.0, settings={"substep": 3})
    with pytest.raises(ConfigError, match="allowed: newton"):
        cloth.simulate(sheet(3, 3, 1, 1), fabric(), seconds=1.0, settings={"solver": "magic"})


def test_wrong_sizes_are_refused():
    with pytest.raises(InputError, match="pinned vertex 9"):
        cloth.simulate(sheet(3, 3, 1, 1), fabric(), seconds=1.0, pinned=[9])
    with pytest.raises(InputError, match="rest shape has 4 vertices, the mesh 9"):
        cloth.simulate(sheet(3, 3, 1, 1), fabric(), seconds=1.0, rest=np.zeros((4, 3)))
