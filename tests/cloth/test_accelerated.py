"""Moves that are carried on: the same rest in fewer steps, and only where nothing but the end matters."""

import numpy as np
import pytest
from cloth_scenes import bead_on_floor, fabric, sheet
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.cloth.collision.contacts import ContactSpan, empty_contacts, gather_contacts
from vto_pipeline.cloth.collision.response.contact_springs import add_contacts, update_active_set
from vto_pipeline.cloth.collision.shapes.colliders import Plane
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth, model_of
from vto_pipeline.cloth.rest.equilibrium import equilibrium
from vto_pipeline.cloth.solvers import newton
from vto_pipeline.cloth.solvers.newton import Limits, Newton
from vto_pipeline.model.garment import RestShape

H = 1.0 / 30.0


def held_bead(share):
    """A bead that springs push aside nearly as hard as others hold it: a share of their stiffness is left."""
    points = np.array([[0.0, 0, 0], [-0.5, 0, 0], [0.5, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
    k = 10.0  # N/m, of what holds it
    pressing = 0.5 * (1.0 - share) * k  # pressed to half their length, two of these push aside with twice as much
    pressed = springs([[0, 1], [0, 2]], points, 1.0 / pressing, rest=1.0)
    holding = springs([[0, 3], [0, 4]], points, 1.0 / k)
    return model_of((pressed, holding), np.full(5, 1e-3), pinned=[1, 2, 3, 4], gravity=(0.0, 0.0, 0.0)), points


@pytest.mark.parametrize("share", [0.01, 0.05, 0.3])
@pytest.mark.parametrize("accelerated", [False, True])
def test_what_is_left_of_a_soft_fold_falls_at_the_rate_of_theory(share, accelerated):
    """z² - (1 + β) (1 - λ) z + β (1 - λ) = 0 (Nesterov 1983), in steps of 10 s, which leave nothing to inertia."""
    model, points = held_bead(share)
    method = Newton(model)
    method.accelerated = accelerated
    floor = Plane((0.0, -5.0, 0.0), (0.0, 1.0, 0.0), 0.0)  # never met; so systems are solved exactly
    contacts = gather_contacts([floor], points, ContactSpan(0.0, 1e4, 10.0, np.full(5, 1e-3), 0.5))
    state = at_rest(points + np.array([[0.0, 1e-6, 0.0]] + 4 * [[0.0, 0.0, 0.0]]))
    heights = []
    for _ in range(60):
        state = method.advance(state, contacts, 10.0, 1)
        heights.append(state.positions[0, 1])
    carried = 0.92 if accelerated else 0.0
    expected = [1e-6, 1e-6 * (1.0 - share)]
    for _ in range(59):
        before, now = expected[-2:]
        expected.append((1.0 - share) * (now + carried * (now - before)))
    assert_allclose(heights, expected[1:], atol=2e-9)


def drooping(side):
    """A sheet held at two corners that are nearer than it is wide, and where it comes to rest by another method."""
    mesh = sheet(side, side, 0.4, 0.4, upright=False)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(bending=2e-5), pinned=[0, side - 1])
    start = mesh.vertices * [0.8, 1.0, 1.0] + 1e-3 * np.random.default_rng(0).standard_normal(mesh.vertices.shape)
    start[[0, side - 1]] = mesh.vertices[[0, side - 1]] * [0.8, 1.0, 1.0]
    return model, equilibrium(model, start).positions


def test_folded_cloth_comes_to_the_same_rest():
    model, rest = drooping(14)
    method = Newton(model, damping=5.0)
    method.accelerated = True
    off = 2e-3 * np.sin(9.0 * rest[:, [2, 0, 1]]) * (model.inverse_mass > 0.0)[:, None]
    floor = Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), 0.0)
    contacts = gather_contacts([floor], rest + off, ContactSpan(0.0, 1e3, 2.0, np.full(len(rest), 1e-3), 0.5))
    state = method.advance(at_rest(rest + off), contacts, H, 100)
    assert np.sqrt(((state.positions - rest) ** 2).sum(axis=1).mean()) < 1e-6


def begins(monkeypatch, method):
    """Where iterations begin, from where their steps begin [m]; filled as steps are taken."""
    found, once = [], method._iterate

    def iterate(x, y, *args, **kwargs):
        found.append(y - x)
        return once(x, y, *args, **kwargs)

    monkeypatch.setattr(method, "_iterate", iterate)
    return found


def test_the_last_move_is_carried_on_only_in_steps_of_one_length(monkeypatch):
    method = Newton(model_of((), np.full(1, 0.01), gravity=(0.0, 0.0, 0.0)))
    method.accelerated = True
    found = begins(monkeypatch, method)
    state = ClothState(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))
    for h, carried in ((H, 0.0), (H, 0.92), (2 * H, 0.0), (2 * H, 0.92)):
        found.clear()
        state = method.advance(state, empty_contacts(1), h, 1)
        assert_allclose(found[0], [[carried * h, 0.0, 0.0]], rtol=1e-12)
    method.exact = True
    found.clear()
    method.advance(state, empty_contacts(1), 2 * H, 1)
    assert_array_equal(found[0], 0.0)


@pytest.mark.parametrize("calm", [True, False])
def test_what_meets_other_contacts_is_not_carried_on(monkeypatch, calm):
    model, state, contacts = bead_on_floor(1e-3, [1.0, 0.0, 0.0])
    method, asked = Newton(model), []
    method.accelerated = True

    def changed(*args):
        asked.append(update_active_set(*args))
        return asked[-1] if calm else 1.0

    monkeypatch.setattr(newton, "update_active_set", changed)
    found = begins(monkeypatch, method)
    firm = []
    monkeypatch.setattr(newton, "add_contacts", lambda *args: firm.append(args[-1]) or add_contacts(*args))
    state = method.advance(state, contacts, H, 1)
    assert len(asked) <= 5  # rounds: the way does not matter
    found.clear()
    firm.clear()
    method.advance(state, contacts, H, 1)
    assert found[0].any() == calm
    assert set(firm) == {calm}  # and known contacts are as firm as the cloth


@pytest.mark.parametrize(("accelerated", "amiss", "rounds"), [(True, 0.2, 1), (True, 0.3, 5), (False, 0.2, 20)])
def test_on_the_way_contacts_are_known_well_enough_if_a_quarter_of_their_forces_is_amiss(
    monkeypatch, accelerated, amiss, rounds
):
    model, state, contacts = bead_on_floor(1e-3, [0.0, 0.0, 0.0])
    method, asked = Newton(model), []
    method.accelerated = accelerated
    method.limits = Limits(iterations=1)
    monkeypatch.setattr(newton, "update_active_set", lambda *args: asked.append(update_active_set(*args)) or amiss)
    method.advance(state, contacts, H, 1)
    assert len(asked) == rounds
