"""A strip clamped at one end, as it comes to rest by default, against the heavy elastica; and what Newton solves."""

import numpy as np
import pytest
from cloth_scenes import fabric
from numpy.testing import assert_allclose
from scipy.integrate import solve_bvp
from scipy.linalg import eigh

from vto_pipeline.cloth import simulate
from vto_pipeline.cloth.constraints.bending.hinge_moments import hinge_moments
from vto_pipeline.cloth.constraints.bending.shape_operator import shape_operator
from vto_pipeline.cloth.constraints.sweep import add_forces, linearised
from vto_pipeline.cloth.swatch.meshes import strip
from vto_pipeline.geometry.remeshing.isotropic import isotropic
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

LENGTH, DENSITY, GRAVITY = 0.04, 0.15, 9.80665


def heavy_elastica(gamma):
    """Reach and drop of the tip in lengths: θ″ = -Γ (1 - s) cos θ, θ(0) = 0, θ′(1) = 0, θ below level."""
    s = np.linspace(0.0, 1.0, 201)
    guess = np.vstack([1.2 * np.tanh(3.0 * s), np.gradient(1.2 * np.tanh(3.0 * s), s)])
    for weight in np.geomspace(min(gamma, 1.0), gamma, 12):
        found = solve_bvp(
            lambda s, y, w=weight: np.vstack([y[1], -w * (1.0 - s) * np.cos(y[0])]),
            lambda a, b: np.array([a[0], b[1]]),
            s,
            guess,
            tol=1e-9,
            max_nodes=20000,
        )
        assert found.success
        s, guess = found.x, found.y
    fine = np.linspace(0.0, 1.0, 20001)
    theta = found.sol(fine)[0]
    return np.trapezoid(np.cos(theta), fine), np.trapezoid(np.sin(theta), fine)


def test_the_elastica_here_is_that_of_the_tables():
    reach, drop = heavy_elastica(20.0)
    assert_allclose(drop / reach, 1.863930, rtol=1e-5)  # the reference table's
    reach, drop = heavy_elastica(2.0)
    assert_allclose(drop / reach, 0.246673, rtol=1e-5)


def plane_mesh(kind, edges):
    """Points and triangles of a strip, and a little of it behind the clamp, where x = 0."""
    edge = LENGTH / edges
    if kind != "remeshed":
        return strip(kind, -2.0 * edge, LENGTH, 0.2 * LENGTH, edge)
    points, faces = strip("grid", 0.0, edges, 0.2 * edges, 1.0)  # its rim stays; inside, triangles split, flip and move
    found = isotropic(
        TriangleMesh(np.column_stack([points, 0.0 * points[:, 0]]), faces), 0.9, 10, features=None, project=True
    )
    points, faces = edge * found.vertices[:, :2], found.faces
    clamped = np.abs(points[:, 0]) < 1e-3 * edge
    near = faces[clamped[faces].any(axis=1)]  # what lies behind is the mirror image of what lies before
    image = np.where(clamped, np.arange(len(points)), len(points) + np.arange(len(points)))
    both = np.vstack([faces, image[near][:, ::-1]])
    used, flat = np.unique(both, return_inverse=True)
    return np.vstack([points, points * [-1.0, 1.0]])[used], flat.reshape(-1, 3).astype(np.int32)


def tip_error(kind, edges, gamma, along, settings=()):
    """Relative error of drop over reach of a strip that bends along its warp or its weft, at rest by default."""
    points, faces = plane_mesh(kind, edges)
    x, y = points.T
    flat = np.column_stack([x, 0.0 * x, -y])  # the warp runs along z where cloth lies level
    if along == "warp":
        flat = np.column_stack([y, 0.0 * x, x])
    stiff = DENSITY * GRAVITY * LENGTH**3 / gamma
    warp, weft = (stiff, 0.5 * stiff) if along == "warp" else (0.5 * stiff, stiff)
    sheet = Fabric("strip", DENSITY, 1e-4, 1000, 1000, 500, 0.0, warp, weft, 0.0, 0.3)
    ended = simulate(
        TriangleMesh(flat, faces),
        sheet,
        pinned=np.flatnonzero(x < 0.01 * LENGTH / edges).tolist(),
        seconds=20.0,
        settings={"until": "rest", "damping": 5.0, "self_collision": False, **dict(settings)},
    )
    assert ended.report["settled"]
    tip = x > x.max() - 0.01 * LENGTH / edges
    out = ended.positions[tip, 2 if along == "warp" else 0].mean()
    reach, drop = heavy_elastica(gamma)
    return float(-ended.positions[tip, 1].mean() / out / (drop / reach) - 1.0)


@pytest.mark.parametrize(
    ("kind", "gamma", "along"), [("grid", 2.0, "weft"), ("irregular", 20.0, "warp"), ("remeshed", 20.0, "weft")]
)
def test_a_clamped_strip_hangs_as_the_elastica_says(kind, gamma, along):
    assert abs(tip_error(kind, 20, gamma, along)) < 0.02


def test_the_hinge_does_not():
    assert tip_error("grid", 20, 2.0, "weft", {"bending": "hinge"}.items()) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["grid", "irregular", "remeshed"])
@pytest.mark.parametrize("gamma", [0.5, 2.0, 20.0, 200.0, 300.0])
@pytest.mark.parametrize("along", ["warp", "weft"])
def test_within_a_percent_at_80_edges(kind, gamma, along):
    assert abs(tip_error(kind, 80, gamma, along)) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["grid", "irregular", "remeshed"])
@pytest.mark.parametrize("gamma", [2.0, 20.0, 200.0])
def test_errors_fall_at_least_with_the_edge(kind, gamma):
    edges = [10, 20, 40, 80]
    errors = [abs(tip_error(kind, count, gamma, "weft")) for count in edges]
    assert -np.polyfit(np.log(edges), np.log(errors), 1)[0] > 1.0


def needles():
    points, faces = strip("irregular", 0.0, 0.4, 0.3, 0.03)
    return points * [1.0, 0.2], faces


@pytest.mark.parametrize(
    ("points", "faces", "least"),
    [(*strip("grid", 0.0, 0.4, 0.3, 0.03), 0.12), (*strip("irregular", 0.0, 0.4, 0.3, 0.03), 0.17), (*needles(), 0.0)],
    ids=["grid", "irregular", "needles"],
)
def test_no_direction_is_stiffer_than_what_stands_for_it(points, faces, least):
    """Of a flat sheet, so that the stiffness is that out of plane: differences of the forces."""
    flat = np.column_stack([points, np.zeros(len(points))])
    data = hinge_moments(shape_operator(TriangleMesh(flat, faces), RestShape(flat), fabric(bending=1e-3)))
    step, count = 1e-7, len(flat)
    exact = np.empty((count, count))
    for column in range(count):
        moved, pull = flat.copy(), np.zeros_like(flat)
        moved[column, 2] = step
        add_forces(moved, (data,), pull)
        exact[:, column] = -pull[:, 2] / step
    _, gradients, compliance = linearised(flat, data)
    slope = np.zeros((len(data.vertices), count))
    np.put_along_axis(slope, data.vertices.astype(np.int64), gradients[:, 0, :, 2], axis=1)
    stand_in = slope.T @ (slope / compliance[:, 0])
    rigid = np.column_stack([np.ones(count), points])
    bending = np.linalg.qr(rigid, mode="complete")[0][:, 3:]
    shares = eigh(bending.T @ exact @ bending, bending.T @ stand_in @ bending, eigvals_only=True)
    assert least < shares.min() < shares.max() < 1.0 + 1e-3


@pytest.mark.parametrize("edge", [0.05, 0.0055])  # the second has so many hinges that threads share them
def test_hinges_and_triangles_have_the_same_energy_and_forces(edge):
    points, faces = strip("irregular" if edge > 0.01 else "grid", 0.0, 0.4, 0.3, edge)
    rest = np.column_stack([points, 0.05 * np.sin(9.0 * points[:, 0])])
    x = rest + np.random.default_rng(0).normal(0.0, 0.08 * edge, rest.shape)
    for bent in (False, True):
        triangles = shape_operator(TriangleMesh(rest, faces), RestShape(rest, rest_angles=bent), fabric(bending=1e-3))
        found = []
        for data in (triangles, hinge_moments(triangles)):
            pull = np.zeros_like(x)
            found.append((add_forces(x, (data,), pull), pull))
        assert found[0][0] > 1e-4
        assert_allclose(found[1][0], found[0][0], rtol=1e-10)  # rounding
        assert_allclose(found[1][1], found[0][1], rtol=0, atol=1e-12 * np.abs(found[0][1]).max())
