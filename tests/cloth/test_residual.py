"""What contacts can bear: closed forms of bodies at rest."""

from __future__ import annotations

import numpy as np
import pytest
from cloth_scenes import fabric, moved, sheet

from vto_pipeline.cloth import Plane, simulate
from vto_pipeline.cloth.collision.response.active_set import ActiveSet, no_contacts
from vto_pipeline.cloth.dynamics.residual import relative_residual
from vto_pipeline.cloth.model.build import build_cloth
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY


def loose():  # type: ignore[no-untyped-def]
    """Return the model of a flat sheet in the air, and its positions."""
    mesh = sheet(5, 5, 0.1, 0.1, upright=False)
    return build_cloth(mesh, RestShape(mesh.vertices), fabric()), mesh.vertices


def planes(x, normal, friction: float) -> ActiveSet:  # type: ignore[no-untyped-def]
    """Return a plane under each vertex."""
    made = no_contacts(len(x))
    made.key[:] = np.arange(len(x))
    made.vertices[:, 0], made.weights[:, 0] = np.arange(len(x)), 1.0
    made.normal[:], made.level[:], made.friction[:] = normal, x @ normal, friction
    return made


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("friction", [0.0, 0.3, 2.0])
def test_an_incline_bears_all_but_what_slides(angle: float, friction: float) -> None:
    model, x = loose()
    normal = np.array([np.sin(angle), np.cos(angle), 0.0])
    left = max(0.0, np.sin(angle) - friction * np.cos(angle))
    assert relative_residual(model, x, planes(x, normal, friction)) == pytest.approx(
        left, rel=1e-9, abs=1e-9
    )  # rounding of large elastic forces


@pytest.mark.parametrize("known", [0.5, 30.0])
def test_what_contacts_are_known_to_bear_makes_them_bear_no_more(known: float) -> None:
    """However hard they pushed and rubbed before, inside their cones or not."""
    model, x = loose()
    angle, friction = 0.7, 0.3
    contacts = planes(x, np.array([np.sin(angle), np.cos(angle), 0.0]), friction)
    contacts.force[:] = known * GRAVITY * model.mass
    contacts.friction_force[:, 1] = 2.0 * contacts.force
    left = np.sin(angle) - friction * np.cos(angle)
    assert relative_residual(model, x, contacts) == pytest.approx(left, rel=1e-9)


def test_the_force_left_is_of_the_mass_that_nothing_bears_however_the_cloth_is_meshed() -> None:
    """A tenth of the vertices, and half the mass, lie on nothing."""
    even = sheet(11, 5, 0.1, 0.1, upright=False)
    x = even.vertices - even.vertices.min(axis=0)
    hanging = x[:, 0] > 0.095
    x[~hanging, 0] *= 0.02
    model = build_cloth(TriangleMesh(x, even.faces), RestShape(x), fabric())
    contacts = planes(x, np.array([0.0, 1.0, 0.0]), 0.3)
    contacts.level[hanging] -= 1e-3
    share = model.mass[hanging].sum() / model.mass.sum()
    assert np.mean(hanging) < 0.1 < 0.4 < share
    assert relative_residual(model, x, contacts) == pytest.approx(np.sqrt(share), rel=1e-6)


def test_what_is_not_touched_bears_nothing() -> None:
    model, x = loose()
    contacts = planes(x, np.array([0.0, 1.0, 0.0]), 0.3)
    contacts.level[:] -= 1e-3
    assert relative_residual(model, x, contacts) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("upwards", [1.0, -1.0])
def test_a_pair_gives_to_one_side_what_it_takes_from_the_other(upwards: float) -> None:
    """The push p that leaves least of Σ m (-1 + w p / m g)², were it free; and none where that would pull."""
    model, x = loose()
    contacts = no_contacts(1)
    touched, weights = [24, 0, 1, 5], np.array([1.0, -1 / 3, -1 / 3, -1 / 3])
    contacts.vertices[0], contacts.weights[0] = touched, weights
    contacts.normal[0] = [0.0, upwards, 0.0]
    contacts.level[0] = 1.0  # they are in each other
    mass = model.mass[touched]
    ratio = upwards * weights / mass
    push = max(0.0, np.average(ratio, weights=mass) / np.average(ratio**2, weights=mass))
    left = np.ones(len(x))
    left[touched] -= ratio * push
    assert relative_residual(model, x, contacts) == pytest.approx(
        np.sqrt(np.average(left**2, weights=model.mass)), rel=1e-9
    )


def test_sheets_that_rest_on_each_other_are_in_balance() -> None:
    """Only contacts of the cloth with itself bear the upper sheet: without them, half the weight would be left over."""
    lower = sheet(6, 6, 0.1, 0.1, upright=False)
    upper = moved(lower, 0.004, 0.0025, 0.003)
    lower = moved(lower, 0.0, 0.0015, 0.0)
    both = TriangleMesh(np.vstack([lower.vertices, upper.vertices]), np.vstack([lower.faces, upper.faces + 36]))
    floor = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.3)
    found = simulate(both, fabric(), colliders=[floor], seconds=1.5, settings={"until": "rest"})
    assert found.report["residual"] < 0.05
    alone = simulate(
        both, fabric(), colliders=[floor], seconds=1.5, settings={"until": "rest", "self_collision": False}
    )
    assert alone.positions[36:, 1].max() < found.positions[36:, 1].min()  # there it lies in the lower one
