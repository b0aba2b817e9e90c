"""Contacts as forces: their potential against finite differences, rest and sliding against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from cloth_scenes import fabric, moved, sheet
from numpy.testing import assert_allclose
from scipy.optimize import check_grad

from vto_pipeline.cloth import Moving, Path, Plane, simulate
from vto_pipeline.cloth.collision.contacts import ContactSpan, gather_contacts
from vto_pipeline.cloth.collision.response.penalty import Penalty
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.cloth.simulation import AnyCollider
from vto_pipeline.errors import ConfigError
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.linear.block_matrix import to_scipy
from vto_pipeline.units import GRAVITY

FABRIC = fabric(stretch=1000.0, shear=200.0, bending=1e-5, density=0.2, friction=0.3)
SINKS = 1e-5  # m, as the module has it


def two_sheets(gap):
    """A small sheet over a larger one, which lies on y = 0."""
    low, high = sheet(5, 5, 0.1, 0.1, upright=False), moved(sheet(4, 4, 0.05, 0.05, upright=False), 0.013, gap, 0.011)
    points, faces = np.vstack([low.vertices, high.vertices]), np.vstack([low.faces, high.faces + len(low.vertices)])
    return TriangleMesh(points, faces.astype(np.int32)), len(low.vertices)


def pressed(slide):
    """Two sheets pressed into each other and into a plane, after a step with friction, and their model."""
    mesh, count = two_sheets(2e-4)
    model = build_cloth(mesh, RestShape(mesh.vertices), FABRIC, gravity=(0.0, -GRAVITY, 0.0))
    x = mesh.vertices + np.random.default_rng(0).uniform(-2e-5, 2e-5, mesh.vertices.shape)
    span = ContactSpan(0.0, 0.01, 0.01, np.full(len(x), 1e-4), 0.5)
    contacts = gather_contacts([Plane((0, 0, 0), (0, 1, 0), 0.3)], x, span)
    pairs = SelfContact(mesh.faces, model.reach, 0.3).find_pairs(x, x.copy(), 0.01)
    assert len(pairs.key) > 20
    penalty = Penalty(model)
    y = x.copy()
    for _ in range(2):
        penalty.begin(contacts, pairs, 0.0, 1.0, x, 0.01)
        y = x.copy()
        y[count:, 0] += slide
        penalty.end(y)
    penalty.begin(contacts, pairs, 0.0, 1.0, x, 0.01)
    return penalty, model, y


@pytest.mark.parametrize("slide", [1e-6, 1e-3])  # what holds, and what slides
def test_forces_are_the_slope_of_the_potential(slide):
    penalty, _, y = pressed(slide)

    def energy(flat):
        return penalty.add_forces(flat.reshape(-1, 3), np.zeros_like(y))

    def slope(flat):
        forces = np.zeros_like(y)
        penalty.add_forces(flat.reshape(-1, 3), forces)
        return -forces.ravel()

    size = np.abs(slope(y.ravel())).max()
    assert size > 0.0
    assert check_grad(energy, slope, y.ravel(), epsilon=1e-10) < 1e-3 * size * np.sqrt(y.size)  # a one-sided difference

    v = np.random.default_rng(1).normal(size=y.shape)
    resistance = np.zeros_like(y)
    power = penalty.add_resistance(y, v, resistance)
    assert_allclose(power, -0.5 * np.vdot(v, resistance), rtol=1e-12, atol=0)  # a quadratic; nothing else moves
    assert power > 0.0


@pytest.mark.parametrize("slide", [1e-6, 1e-3])
def test_the_stiffness_bounds_that_of_the_forces(slide):
    penalty, model, y = pressed(slide)
    stiffness = Stiffness(model)
    bare = to_scipy(stiffness.assemble(y)).toarray()
    matrix = stiffness.assemble(y)
    penalty.add_to(matrix, y, 0.0)
    added = to_scipy(matrix).toarray() - bare
    step, found = 1e-9, np.empty((y.size, y.size))
    for k in range(y.size):
        sides = []
        for sign in (1.0, -1.0):
            there, forces = y.copy(), np.zeros_like(y)
            there.flat[k] += sign * step
            penalty.add_forces(there, forces)
            sides.append(forces.ravel())
        found[:, k] = (sides[1] - sides[0]) / (2.0 * step)
    values = np.linalg.eigvalsh(added - 0.5 * (found + found.T))
    assert values.min() > -1e-4 * np.abs(found).max()  # rounding of the differences
    assert np.abs(found).max() > 0.1 * np.abs(added).max()  # and it is not far from them


@pytest.mark.parametrize("solver", ["symplectic_euler", "backward_euler", "bdf2"])
def test_at_rest_the_springs_bear_the_weight(solver):
    mesh, skin = moved(sheet(5, 5, 0.1, 0.1, upright=False), 0, 1e-3, 0), 1e-3
    settings = {"solver": solver, "contact_forces": True, "skin_mm": 1e3 * skin, "damping": 2.0}
    ended = simulate(mesh, FABRIC, colliders=[Plane((0, 0, 0), (0, 1, 0), 0.3)], seconds=1.0, settings=settings)
    assert_allclose(skin - ended.positions[:, 1], SINKS, rtol=0.01, atol=0)  # each sinks alike: it stays flat


@pytest.mark.parametrize("solver", ["symplectic_euler", "backward_euler"])
@pytest.mark.parametrize("friction", [0.3, 0.6])
@pytest.mark.parametrize("steeper", [0.97, 1.2])
def test_it_slides_if_the_slope_exceeds_friction(solver, friction, steeper):
    slope, skin = np.arctan(steeper * friction), 1e-3
    normal = np.array([np.sin(slope), np.cos(slope), 0.0])
    along = np.array([np.cos(slope), -np.sin(slope), 0.0])
    flat = sheet(4, 4, 0.1, 0.1, upright=False)
    start = flat.vertices[:, :1] * along + flat.vertices[:, 2:] * np.array([0, 0, 1.0]) + (skin - SINKS) * normal
    settings = {"solver": solver, "contact_forces": True, "skin_mm": 1e3 * skin}
    early, late = (
        simulate(
            TriangleMesh(start, flat.faces),
            replace(FABRIC, friction=friction),
            colliders=[Plane((0, 0, 0), tuple(normal), friction)],
            seconds=seconds,
            settings=settings,
        )
        for seconds in (0.25, 0.5)
    )
    slid, gained = (
        ((one - other) @ along).mean()
        for one, other in (
            (late.positions, early.positions),
            (late.velocities, early.velocities),
        )
    )
    if steeper < 1.0:  # once the springs of the friction are drawn
        assert abs(slid) < 1e-6
    else:
        free = GRAVITY * 0.25 * (np.sin(slope) - friction * np.cos(slope))
        assert_allclose(gained, free, rtol=0.02, atol=0)  # first order


@pytest.mark.parametrize("solver", ["verlet", "backward_euler"])
def test_a_sheet_lies_on_another(solver):
    mesh, count = two_sheets(1e-3)
    mesh = moved(mesh, 0, 2e-3, 0)
    settings = {"solver": solver, "contact_forces": True, "damping": 2.0, "skin_mm": 1.0}
    ended = simulate(mesh, FABRIC, colliders=[Plane((0, 0, 0), (0, 1, 0), 0.3)], seconds=0.5, settings=settings)
    assert len(self_intersections(TriangleMesh(ended.positions, mesh.faces))) == 0
    above = ended.positions[count:, 1] - ended.positions[:count, 1].max()
    assert (above > 0.0).all()
    assert (above < 1.2 * FABRIC.thickness).all()


def test_dampers_go_with_what_moves():
    """Cloth on a plane that sinks steadily sinks with it, as deep in it as at rest."""
    mesh, skin, speed = moved(sheet(3, 3, 0.05, 0.05, upright=False), 0, 1e-3 - SINKS, 0), 1e-3, 0.5
    path = Path(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], [0.0, -speed, 0.0]]))
    solid: AnyCollider = Moving(Plane((0, 0, 0), (0, 1, 0), 0.3), path)
    settings = {"solver": "backward_euler_newton", "contact_forces": True, "skin_mm": 1e3 * skin}
    ended = simulate(mesh, FABRIC, colliders=[solid], seconds=0.8, settings=settings)
    depth = skin - (ended.positions[:, 1] + speed * 0.8)
    assert_allclose(depth, SINKS, rtol=0.05, atol=0)


def test_who_knows_no_forces_says_so():
    with pytest.raises(ConfigError, match="contact_forces"):
        simulate(sheet(3, 3, 0.1, 0.1), FABRIC, seconds=0.1, settings={"contact_forces": True})
