"""An arm that comes out of a filling: out of a filled cuff, and of a sleeve torn from its cuff down to the hem."""

from __future__ import annotations

import dressed_form
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.lifting import lift_fillings, pierced_fillings
from vto_pipeline.garment.loop_evidence import encloses
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.garment.pierced import open_pierced
from vto_pipeline.geometry.remeshing.holes import fill_holes
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_loops, boundary_walks, concatenate, submesh, vertex_normals
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def torn_from_cuff_to_hem(scene):
    """The cuff, the strip below it and the hem become one loop."""
    x, y, z = scene.shirt.vertices[scene.shirt.faces].mean(axis=1).T
    below_the_arm = (0.15 - x + 0.70 - y) / np.sqrt(2)
    return submesh(scene.shirt, ~((x > 0.1) & (below_the_arm > 0.0) & (np.abs(z) < 0.06)))[0]


def seen_bare(scene, torn):
    out = dressed_form.shirt_region(scene.form.vertices) > 0.004
    bare = submesh(scene.form, out[scene.form.faces].all(axis=1))[0]
    garment = np.arange(len(torn.vertices) + len(bare.vertices)) < len(torn.vertices)
    return BareParts(concatenate([torn, bare]), SurfaceLabels(garment, np.ones(len(garment))), scene.form)


def tube(radius, low, high, around=90, along=60):
    """About +Y, open at both ends."""
    turn, up = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    angle = 2.0 * np.pi * turn.ravel() / around
    height = low + (high - low) * up.ravel() / (along - 1)
    vertices = np.column_stack([radius * np.sin(angle), height, radius * np.cos(angle)])
    at = np.arange(around * along).reshape(around, along)
    beside = np.roll(at, -1, axis=0)
    a, b, c, d = (one.ravel() for one in (at[:, :-1], beside[:, :-1], beside[:, 1:], at[:, 1:]))
    return TriangleMesh(vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


SLEEVE, ARM, CUFF = 0.1, 0.08, 0.4


def opened_cuff(bare):
    """A sleeve whose cuff was filled, opened again."""
    sleeve, arm = tube(SLEEVE, 0.0, CUFF), fill_all(tube(ARM, -0.3, 0.8, along=200))
    walk = max(boundary_walks(sleeve), key=lambda one: sleeve.vertices[sleeve.faces[one // 3, 0], 1].mean())
    filled, distance = fill_holes(sleeve, [walk]), SurfaceDistance(arm)
    new = np.arange(len(filled.vertices)) >= len(sleeve.vertices)
    beyond = submesh(arm, (arm.vertices[arm.faces][:, :, 1] > CUFF).all(axis=1))[0]
    labels = SurfaceLabels(np.zeros(len(beyond.vertices), bool), np.ones(len(beyond.vertices)))
    parts = BareParts(beyond, labels, arm) if bare else None
    pierced = pierced_fillings(lift_fillings(filled, new, distance, 0.001), distance, parts)
    assert len(pierced) == 1
    return sleeve, open_pierced(filled, len(sleeve.faces), pierced, arm, parts, 0.001, Job()), distance


def fill_all(mesh):
    return fill_holes(mesh, boundary_walks(mesh))


def test_over_an_arm_that_was_seen_bare_nothing_is_left_of_a_filling():
    sleeve, opened, _ = opened_cuff(bare=True)
    assert_allclose(opened.vertices, sleeve.vertices)
    assert_array_equal(opened.faces, sleeve.faces)


def test_what_is_left_of_a_filling_runs_along_the_arm_and_not_into_it():
    """It goes on as the sleeve does; where it bends down to the arm by more than 63 degrees it is no cloth."""
    sleeve, opened, distance = opened_cuff(bare=False)
    assert_array_equal(opened.faces[: len(sleeve.faces)], sleeve.faces)
    left = opened.faces[len(sleeve.faces) :]
    assert (np.hypot(*opened.vertices[left].mean(axis=1)[:, ::2].T) > ARM).all()
    normals = vertex_normals(opened)[np.unique(left)]
    outward = opened.vertices[np.unique(left)] * [1, 0, 1]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.quantile(np.einsum("vd,vd->v", normals, outward), 0.05) > 0.4
    rims = [opened.vertices[loop] for loop in boundary_loops(opened)]
    assert len(rims) == 2
    assert all(encloses(rim, distance, 0.06) for rim in rims)


@pytest.mark.parametrize("given", [True, False])
def test_a_cuff_that_was_filled_through_the_arm_is_opened_where_it_is(scene, given):
    torn, job = torn_from_cuff_to_hem(scene), Job()
    bare = seen_bare(scene, torn) if given else None
    garment, found, observed = close_scan_holes(torn, scene.form, OpeningsConfig(), job, bare)
    _, true, _ = close_scan_holes(scene.shirt, scene.form, OpeningsConfig(), Job())
    assert len(found) == len(true) == 4
    cuff, whole = (max(openings, key=lambda one: one.center[0]) for openings in (found, true))
    assert np.linalg.norm(cuff.center - whole.center) < 0.03
    assert abs(cuff.perimeter / whole.perimeter - 1.0) < 0.25
    assert np.mean(observed[cuff.loop]) < 0.5  # it is marked as not seen
    assert any("opened there" in warning for warning in job.warnings)
    points, _, _ = sample_surface(garment, 4000, 0)
    assert SurfaceDistance(scene.form).signed(points).distance.min() > -0.003
