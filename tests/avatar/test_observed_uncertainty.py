"""How surely a registered body is known where the scan shows it: closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.measuring_levels import level_spread
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.avatar.model.shape import shape_space
from vto_pipeline.avatar.scan.correspondence import Target
from vto_pipeline.avatar.scan.uncertainty.observed import level_sigmas, surface_sigmas
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.body import Avatar, Measurements


@pytest.fixture(scope="module")
def body() -> Avatar:
    return fit_measurements(Measurements({"stature": 1.70, "chest_girth": 0.99, "hip_girth": 1.07}, sex="female"))


def test_a_level_is_known_as_well_as_the_body_is_curved_there(body: Avatar) -> None:
    """Seats of a given curvature: a parabola z = -c y^2 stays within 1 mm over the root of 1 mm / c each way."""
    wide = {}
    for curvature in (3.0, 12.0):
        points = body.bind_vertices.copy()
        behind = (points[:, 2] < -0.02) & (np.abs(points[:, 1] - points[body.loops["hip"], 1].mean()) < 0.13)
        up = points[behind, 1] - points[body.loops["hip"], 1].mean()
        points[behind, 2] = -0.25 + curvature * up**2
        wide[curvature] = level_spread(points, body)["hip"]
    for curvature, found in wide.items():
        # the profile is looked at every 2 mm, on facets of 15 mm
        assert_allclose(found, np.sqrt(1e-3 / curvature), rtol=0, atol=0.004)


def test_a_girth_on_a_flank_is_less_sure_than_one_at_an_extreme(body: Avatar) -> None:
    """The chain rule: slope of the girth along the body, by differences, times the level's own uncertainty."""
    sigmas, tape = level_sigmas(body), Tape(body)
    for row in ("navel", "high_hip"):
        what = DEFINITIONS[f"{row}_girth"]
        reach = sigmas["navel_height"]
        ends = [tape._across(what, body.bind_vertices, "left", shift).value for shift in (reach, -reach)]
        assert_allclose(sigmas[f"{row}_girth"], abs(ends[0] - ends[1]) / 2, rtol=0.25)
    per_level = {row: sigmas[f"{row}_girth"] / sigmas[f"{row}_height"] for row in ("hip", "navel")}
    assert per_level["hip"] < 0.5 * per_level["navel"]
    # ANSUR II: a navel's height where stature, waist's and hip's are known
    assert 0.008 < sigmas["navel_height"] < 0.025
    assert sigmas["stature"] == sigmas["wrist_girth"] == sigmas["shoulder_length"] == 0.0


def test_a_surface_that_errs_makes_girths_err(body: Avatar) -> None:
    """By drawing surfaces: random fields along the normals, alike over 4 cm."""
    space, rng = shape_space(0.0), np.random.default_rng(2)
    points = body.bind_vertices
    off = 0.001
    moved = replace(body, vertices=body.vertices + off * vertex_normals(body.mesh))
    sigmas = surface_sigmas(space, Target(moved.mesh, 500, 0), body)
    band = np.flatnonzero(np.abs(points[:, 1] - points[body.loops["hip"], 1].mean()) < 0.06)
    apart = np.linalg.norm(points[band, None] - points[None, band], axis=2)
    root = np.linalg.cholesky(np.exp(-((apart / 0.04) ** 2)) + 1e-6 * np.eye(len(band)))
    normals, tape, found = vertex_normals(body.mesh), Tape(body), []
    for _ in range(200):
        there = points.copy()
        there[band] += off * (root @ rng.normal(size=len(band)))[:, None] * normals[band]
        found.append(tape.read(DEFINITIONS["hip_girth"], there).value)
    assert_allclose(sigmas["hip_girth"], np.std(found), rtol=0.25)  # hull corners come and go
