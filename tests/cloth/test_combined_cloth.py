"""Several garments as one cloth: nothing of them is lost, and between two of them their own friction acts."""

from dataclasses import replace

import numpy as np
import pytest
from cloth_scenes import ball, fabric, moved, sheet, tube
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.cloth.collision.contacts import ContactSpan
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.outfit.combined_cloth import MultiFrictionBody, combine_garments
from vto_pipeline.model.garment import Garment, RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.outfit import Layer
from vto_pipeline.units import GRAVITY


def layer(name, mesh, cloth, rest=None, **more):
    return Layer(name, Garment(mesh, RestShape(mesh.vertices if rest is None else rest, **more)), cloth)


def crumpled(mesh, seed):
    noise = np.random.default_rng(seed).standard_normal(mesh.vertices.shape)
    return TriangleMesh(mesh.vertices + 2e-3 * noise, mesh.faces)


def test_energies_forces_and_masses_are_those_of_each_alone():
    stiff, soft = fabric(stretch=2000.0, bending=1e-4, density=0.3), fabric(stretch=100.0, bending=1e-6, density=0.1)
    one, two = tube(0.1, 0.2, 24, 9), tube(0.12, 0.3, 20, 11)
    layers = [
        layer("one", crumpled(one, 0), stiff, one.vertices),
        layer("two", crumpled(two, 1), soft, two.vertices, rest_angles=True),
    ]
    joined = combine_garments(layers, DrapeConfig())
    alone = [build_cloth(each.garment.mesh, each.garment.rest, each.fabric) for each in layers]
    x = joined.mesh.vertices
    energies = [elastic_energy(model, each.garment.mesh.vertices) for model, each in zip(alone, layers, strict=True)]
    # rest shapes stand 10 m apart: lengths of 0.01 m lose four digits of sixteen
    assert_allclose([elastic_energy(model, x) for model in joined.models], energies, rtol=1e-9)
    assert_allclose(elastic_energy(joined.model, x), sum(energies), rtol=1e-9)
    forces, apart = np.zeros_like(x), []
    add_forces(x, joined.model.constraints, forces)
    for model, each in zip(alone, layers, strict=True):
        apart.append(np.zeros_like(each.garment.mesh.vertices))
        add_forces(each.garment.mesh.vertices, model.constraints, apart[-1])
    assert_allclose(forces, np.vstack(apart), rtol=0, atol=1e-9 * np.abs(forces).max())
    assert_allclose(joined.model.mass, np.concatenate([model.mass for model in alone]), rtol=1e-9)
    assert_allclose(joined.model.reach, np.concatenate([model.reach for model in alone]), rtol=1e-9)


@pytest.mark.parametrize(("lower", "upper"), [(0.1, 0.9), (0.9, 0.1), (0.3, 0.3)])
def test_one_cloth_slides_down_another_with_the_geometric_mean_of_their_friction(lower, upper):
    floor = sheet(15, 15, 0.6, 0.6, upright=False)
    patch = sheet(7, 7, 0.1, 0.1, upright=False)
    patch = moved(patch, 0.15, 3e-4, 0.25)
    cloths = [replace(fabric(bending=1e-4), friction=friction) for friction in (lower, upper)]
    joined = combine_garments([layer("floor", floor, cloths[0]), layer("patch", patch, cloths[1])], DrapeConfig())
    held = joined.model.inverse_mass.copy()
    held[joined.vertices[0]] = 0.0
    slope, seconds = np.arctan(0.6), 0.05
    down = GRAVITY * np.array([np.sin(slope), -np.cos(slope), 0.0])
    model = replace(joined.model, inverse_mass=held, gravity=down)
    stepper = Stepper(model, [], np.full(len(held), 1e-3), DrapeConfig(substeps=64))
    found = stepper.run(at_rest(joined.mesh.vertices), seconds).positions[joined.vertices[1]]
    way = (found - patch.vertices).mean(axis=0)
    wanted = 0.5 * GRAVITY * (np.sin(slope) - 0.3 * np.cos(slope)) * seconds**2
    assert_allclose(way[0], wanted, rtol=0.02)  # 192 steps of first order, and 0.15 mm in which it lands


def test_each_vertex_touches_the_body_with_its_own_friction():
    body = ball(0.2, levels=4)
    cloth = tube(0.201, 0.1, 24, 7, base=-0.05)
    friction = np.where(np.arange(len(cloth.vertices)) % 3 == 0, 0.2, 0.7)
    span = ContactSpan(0.0, 0.01, 5e-3, np.full(len(friction), 2e-3), 0.5)
    found = MultiFrictionBody(body, friction, Job()).contacts(cloth.vertices, span)
    plain = MultiFrictionBody(body, np.full(len(friction), 0.5), Job()).contacts(cloth.vertices, span)
    assert_array_equal(found.active.sum(axis=0), plain.active[0])  # once each, where there is contact at all
    assert plain.active.sum() > 100
    of_vertex = found.friction[found.active.argmax(axis=0)]
    assert_array_equal(of_vertex[plain.active[0]], friction[plain.active[0]])
    for ours, theirs in ((found.point, plain.point), (found.normal, plain.normal), (found.offset, plain.offset)):
        assert_array_equal(ours[found.active.argmax(axis=0), np.arange(len(friction))], theirs[0])
