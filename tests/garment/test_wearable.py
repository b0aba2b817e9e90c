"""A garment is open: solids and bodies are refused, cloth modelled with both its sides is not."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vto_pipeline.errors import InputError
from vto_pipeline.garment.openings import list_openings
from vto_pipeline.garment.wearable import check_wearable, warn_one_sided
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def mesh_of(*parts: trimesh.Trimesh) -> TriangleMesh:
    whole = trimesh.util.concatenate(parts)
    return TriangleMesh(whole.vertices, whole.faces)


def check(mesh: TriangleMesh) -> None:
    check_wearable(mesh, list_openings(mesh))


@pytest.mark.parametrize(
    "solid",
    [
        trimesh.creation.icosphere(3, 0.4),
        trimesh.creation.box((0.4, 1.7, 0.3)),
        trimesh.creation.capsule(1.2, 0.2),
        trimesh.creation.torus(0.3, 0.1),
    ],
)
def test_a_solid_is_refused(solid):
    with pytest.raises(InputError, match="no body can get into this: 100%"):
        check(mesh_of(solid))


def test_a_hole_that_no_hand_goes_through_is_no_opening():
    ball = trimesh.creation.icosphere(5, 0.4)
    away = np.linalg.norm(ball.triangles_center - [0, 0.4, 0], axis=1)
    with pytest.raises(InputError, match="the longest loop is"):
        check(TriangleMesh(ball.vertices, ball.faces[away > 0.015]))
    check(TriangleMesh(ball.vertices, ball.faces[away > 0.06]))


def test_cloth_with_both_its_sides_and_buttons_is_a_garment():
    """A skirt 3 mm thick is a closed surface, and so is each button of a shirt."""
    skirt = trimesh.creation.annulus(r_min=0.197, r_max=0.2, height=0.6, sections=64)
    check(mesh_of(skirt))
    button = trimesh.creation.icosphere(1, 0.03)
    tube = trimesh.creation.cylinder(0.2, 0.6, sections=64)
    side = np.abs(tube.face_normals[:, 2]) < 0.5
    open_tube = trimesh.Trimesh(tube.vertices, tube.faces[side], process=False)
    check(mesh_of(open_tube, button))


NECK, HEM, WAIST = (0.0, 1.45, 0.6), (0.0, 0.9, 1.0), (0.0, 1.0, 0.75)
LEFT, RIGHT = (0.2, 1.35, 0.45), (-0.2, 1.3, 0.5)
JOINED, FLAT = (-0.1, 1.4, 1.05), (-0.05, 1.4, 0.9)


@pytest.mark.parametrize(
    ("openings", "warned"),
    [
        ((NECK, LEFT, RIGHT, HEM), False),
        ((WAIST, (0.1, 0.1, 0.5), (-0.1, 0.1, 0.52)), False),  # trousers
        ((WAIST, HEM), False),
        ((JOINED, LEFT, HEM), True),
        ((FLAT, LEFT, HEM), True),
    ],
)
def test_an_armhole_at_one_side_only_is_warned_of(openings, warned):
    """Each opening: where it is, from side to side and up, and its length [m]."""
    loop, up = np.zeros(0, dtype=np.int32), np.array([0.0, 1.0, 0.0])
    job = Job()
    warn_one_sided([Opening(loop, length, np.array([x, y, 0.0]), up) for x, y, length in openings], job)
    assert len(job.warnings) == warned
    for warning in job.warnings:
        assert "the opening of 450 mm at (0.20, 1.35, 0.00) m" in warning
