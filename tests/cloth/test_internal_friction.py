"""Internal friction and plasticity against the closed form of a spring beside a spring with a slider."""

import numpy as np
import pytest
from cloth_scenes import sheet
from numpy.testing import assert_allclose

from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.constraints.bending.bend_friction import bend_friction
from vto_pipeline.cloth.constraints.bending.hinge import bend, solid_hinges
from vto_pipeline.cloth.constraints.membrane.strain_friction import strain_friction
from vto_pipeline.cloth.constraints.membrane.stretch import stretch
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth, model_of
from vto_pipeline.cloth.model.internal_friction import copy_sliders, restore_sliders, slip, with_own_sliders
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.geometry.topology import hinges
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.mechanics.bending import dihedral

RIGIDITY, MOMENT, SLIP = 2e-3, 1e-2, 1.0  # B [N·m], HB [N], curvature at which the slider gives way [1/m]
STRIP = sheet(2, 5, 0.05, 0.2)  # one cell wide: its hinges across turn, and the diagonals stay flat
SIDE = 0.05


def rolled(curvature):
    """The strip bent to a polygon of four facets, with an angle of side times curvature at each fold."""
    turn = SIDE * curvature * np.arange(4)
    steps = SIDE * np.column_stack([np.zeros(4), -np.cos(turn), np.sin(turn)])
    rows = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    x = np.repeat(rows, 2, axis=0)
    x[:, 0] = STRIP.vertices[:, 0]
    return x


def strip(moment=MOMENT):
    """A strip with elastic bending and friction."""
    rest = RestShape(STRIP.vertices)
    found = solid_hinges(STRIP, rest)
    fabric = Fabric("strip", 0.2, 3e-4, 1e3, 1e3, 100, 0, RIGIDITY, RIGIDITY, 2 * moment, 0.3)
    elastic = bend(STRIP, rest, fabric)
    stiffness = moment / SLIP * found.length**2 / found.area
    friction = bend_friction(found, rest, stiffness, moment * found.length)
    return with_own_sliders(model_of((elastic, friction), np.ones(len(STRIP.vertices))))


def energy(model, x):
    return add_forces(x, model.constraints, np.zeros_like(x))


def moment_per_width(model, curvature):
    """dE/dκ over the area that bends: three folds of four cells' rows turn."""
    step = 1e-5
    change = energy(model, rolled(curvature + step)) - energy(model, rolled(curvature - step))
    return change / (2.0 * step) / (3 * SIDE * SIDE)


def cycled(model, path):
    """The moments along a path of curvatures, the sliders giving way after each point."""
    found = []
    for curvature in path:
        found.append(moment_per_width(model, curvature))
        slip(rolled(curvature), model.constraints)
    return np.array(found)


PEAK = 6.0
UP, DOWN = np.linspace(0.0, PEAK, 61), np.linspace(PEAK, -PEAK, 121)


def test_a_cycled_strip_runs_through_the_loop_of_its_hysteresis():
    model = strip()
    path = np.concatenate([UP, DOWN, DOWN[::-1], DOWN])
    moments = cycled(model, path)
    loop, bent = moments[-242:], path[-242:]
    area = abs(np.trapezoid(loop, bent))
    # a parallelogram: 2HB high, as wide as the whole cycle less the spring's own way to and fro
    assert_allclose(area, 2 * MOMENT * (2 * PEAK - 2 * SLIP), rtol=2e-3)  # corners, cut by the steps of 0.1
    falling = moments[-121:]
    middle = abs(DOWN) < 3.0
    assert_allclose(falling[middle], RIGIDITY * DOWN[middle] - MOMENT, rtol=0, atol=1e-8)  # M = B κ ∓ HB
    assert_allclose(moments[:11], (RIGIDITY + MOMENT / SLIP) * UP[:11], rtol=0, atol=1e-7)  # sticking, at first


def test_what_is_left_at_no_moment_is_the_residual_curvature():
    model = strip(moment=RIGIDITY)  # HB / B = 1/m
    cycled(model, UP)
    moments = cycled(model, DOWN)
    zero = np.interp(0.0, -moments, DOWN)
    # unloading from B κ + HB with both springs until the slider gives way, then along B κ - HB
    assert_allclose(zero, 1.0, rtol=0, atol=1e-6)  # 2HB / 2B


def test_no_point_of_a_path_creates_energy():
    model, x = strip(), rolled(0.0)
    rng = np.random.default_rng(4)
    lost = 0.0
    for curvature in np.cumsum(rng.normal(0.0, 2.0, 50)):
        before = energy(model, rolled(curvature))
        x = rolled(curvature) + rng.normal(0.0, 1e-3, x.shape)
        before = energy(model, x)
        slip(x, model.constraints)
        after = energy(model, x)
        assert after <= before * (1.0 + 1e-12)
        lost += before - after
    assert lost > 0.0


def test_a_slip_moves_no_force():
    """The return mapping is implicit: the force before the sliders give way is that after."""
    model, x = strip(), rolled(4.0)
    before, after = np.zeros_like(x), np.zeros_like(x)
    add_forces(x, model.constraints, before)
    slip(x, model.constraints)
    add_forces(x, model.constraints, after)
    assert_allclose(after, before, rtol=0, atol=1e-14)
    assert np.abs(copy_sliders(model)[0]).max() > 0.1


def test_shear_runs_through_its_loop():
    mesh, shear, loss, slipped = sheet(2, 2, 0.1, 0.1), 100.0, 4.0, 0.01
    fabric = Fabric("square", 0.2, 3e-4, 1e3, 1e3, shear, 0, 0, 0, 0, 0.3)
    friction = strain_friction(mesh.faces, RestShape(mesh.vertices), slipped, (0.0, 0.0, 0.5 * loss))
    model = with_own_sliders(model_of((stretch(mesh.faces, RestShape(mesh.vertices), fabric), friction), np.ones(4)))

    def sheared(angle):
        return mesh.vertices @ np.array([[np.cos(angle), np.sin(angle), 0], [0, 1, 0], [0, 0, 1]])

    path = np.concatenate([np.linspace(0, 0.1, 51), np.linspace(0.1, -0.1, 101), np.linspace(-0.1, 0.1, 101)])
    stresses = []
    for angle in path:
        step = 1e-6
        change = energy(model, sheared(angle + step)) - energy(model, sheared(angle - step))
        stresses.append(change / (2 * step) / 0.01)
        slip(sheared(angle), model.constraints)
    area = abs(np.trapezoid(stresses[-202:], path[-202:]))
    assert_allclose(area, loss * (0.2 - 2 * slipped), rtol=0.02)  # corners, cut by steps of 0.002


def test_plastic_bending_yields_hardens_and_keeps_a_crease():
    yields, hardening = 5.0, 0.25
    fabric = Fabric("paper", 0.2, 3e-4, 1e3, 1e3, 100, 0, RIGIDITY, RIGIDITY, 0, 0.3)
    materials = Materials(yield_curvature=yields, hardening=hardening)
    built = build_cloth(STRIP, RestShape(STRIP.vertices), fabric, materials=materials)
    model = with_own_sliders(model_of(built.constraints[:2], built.mass))  # without the membrane
    path = np.linspace(0.0, 20.0, 201)
    moments = cycled(model, path)
    expected = RIGIDITY * np.where(path < yields, path, yields + hardening * (path - yields))
    assert_allclose(moments, expected, rtol=0, atol=1e-7)  # finite difference
    back = cycled(model, np.linspace(20.0, 10.0, 101))
    crease = np.interp(0.0, -back, np.linspace(20.0, 10.0, 101))
    assert_allclose(crease, 20.0 - expected[-1] / RIGIDITY, rtol=1e-6)  # unloads with the whole rigidity


@pytest.mark.parametrize("solver", ["xpbd", "newton"])
def test_a_state_carries_what_its_cloth_remembers(solver):
    if solver not in SOLVERS:
        pytest.skip(f"no solver {solver}")
    model = strip()
    held = [v for v in range(10) if v > 3]
    start = ClothState(rolled(8.0), np.zeros((10, 3)))
    clamped = model_of(model.constraints, model.mass, pinned=held, gravity=(0.0, 0.0, 0.0))
    method = SOLVERS[solver](clamped)
    once = method.advance(start, empty_contacts(10), 1e-3, 4)
    assert np.abs(once.sliders[0]).max() > 0.1
    again = method.advance(
        start, empty_contacts(10), 1e-3, 4
    )  # from the same state the same way, whatever came between
    assert_allclose(again.positions, once.positions, rtol=0, atol=0)
    two = method.advance(method.advance(start, empty_contacts(10), 1e-3, 2), empty_contacts(10), 1e-3, 2)
    assert_allclose(two.positions, once.positions, rtol=0, atol=1e-15)
    assert np.abs(model.constraints[1].slider).max() == 0.0  # the model is as it was


def test_a_state_without_memory_starts_at_rest():
    model = strip()
    slip(rolled(9.0), model.constraints)
    assert np.abs(copy_sliders(model)[0]).max() > 0.1
    restore_sliders(model, at_rest(rolled(0.0)).sliders)
    assert np.abs(copy_sliders(model)[0]).max() == 0.0


def test_folds_of_the_strip_are_what_they_are_said_to_be():
    x = rolled(3.0)
    fold = [v for v in hinges(STRIP) if abs(STRIP.vertices[v[0], 1] - STRIP.vertices[v[1], 1]) < 1e-9]
    for a, b, c, d in fold:
        angle = dihedral(tuple(x[a]), tuple(x[b]), tuple(x[c]), tuple(x[d]))[0]
        assert_allclose(abs(angle), 3.0 * SIDE, rtol=1e-12)
