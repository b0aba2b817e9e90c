"""Parts of a form that come out too thick in a scan, and cloth that lies close where none do."""

import numpy as np
import pytest
import trimesh
from dressed_form import HIGH, LOW, form_distance, level_set, outward

from vto_pipeline.garment.subtraction.subtract import SubtractConfig, label_garment
from vto_pipeline.garment.subtraction.thin_parts import thin_parts
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

FORM, CLOTH = np.array([200, 165, 140]), np.array([200, 190, 60])
WIDTH, BUST, OFF, NOISE = 0.016, 0.66, 0.003, 4e-4


def mesh_of(shape) -> TriangleMesh:
    return TriangleMesh(np.asarray(shape.vertices), np.asarray(shape.faces, np.int32))


@pytest.mark.parametrize(
    ("shape", "thin"),
    [
        (trimesh.creation.icosphere(4, radius=0.04), True),
        (trimesh.creation.icosphere(4, radius=0.08), False),
        (trimesh.creation.cylinder(0.01, 0.08, sections=64).subdivide_to_size(0.004), True),  # a finger, tips and all
    ],
)
def test_balls_and_fingers_are_thin_or_not_all_over(shape, thin):
    """Ways through a ball of radius r are 2 r along the normal, and 2 r cos 45 degrees all round in the cone."""
    assert thin_parts(mesh_of(shape)).mean() == pytest.approx(float(thin), abs=0.02)


def test_the_tips_of_a_long_rod_are_thin_too():
    """Along its axis a rod of 6 cm is 50 cm through."""
    rod = trimesh.creation.cylinder(0.03, 0.5, sections=64).subdivide_to_size(0.01)
    assert thin_parts(mesh_of(rod)).mean() > 0.98


def test_a_strap_that_shares_the_forms_colours_is_cloth_by_its_distance():
    """Each of its vertices has the form's colour to some part: pixels at its edges see both."""
    noise = np.random.default_rng(0)
    form = outward(*level_set(form_distance, LOW, HIGH, 0.008))
    bare = outward(*level_set(form_distance, LOW, HIGH, 0.005))
    x, y, _ = bare.vertices.T
    top = (y > 0.35) & (y < BUST) & (np.abs(x) < 0.165)
    strap = (np.abs(np.abs(x) - 0.1) < 0.5 * WIDTH) & (y >= BUST)
    off = np.where(top | strap, OFF, 0.0) + noise.normal(0.0, NOISE, len(x))
    share = np.where(top, 1.0, np.where(strap, noise.uniform(0.0, 0.7, len(x)), 0.0))[:, None]
    colors = share * CLOTH + (1.0 - share) * FORM + noise.normal(0.0, 8.0, (len(x), 3))
    surface = TriangleMesh(
        bare.vertices + off[:, None] * vertex_normals(bare), bare.faces, np.clip(colors, 0, 255).astype(np.uint8)
    )
    labels = label_garment(surface, form, SubtractConfig(), Job())
    assert strap.sum() > 300
    assert labels.garment[strap].mean() > 0.9
    assert labels.garment[~strap & ~top].mean() < 0.01
