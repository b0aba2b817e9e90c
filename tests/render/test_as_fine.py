"""What is shown is no coarser than what was simulated."""

from __future__ import annotations

import numpy as np
import pytest

from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.render.dress import DressConfig, as_fine_as, deform_render_mesh

RADIUS = 0.2


def sheet(count: int) -> TriangleMesh:
    """A sheet of 0.6 m by 0.6 m in count² squares, with places in a picture."""
    x, z = np.meshgrid(np.linspace(0, 0.6, count + 1), np.linspace(0, 0.6, count + 1), indexing="ij")
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    beside, above = corner + 1, corner + count + 1
    faces = np.vstack([np.column_stack([corner, beside, above]), np.column_stack([beside, above + 1, above])])
    points = np.column_stack([x.ravel(), 0 * x.ravel(), z.ravel()])
    return TriangleMesh(points, faces, texture=points[faces][..., [0, 2]])


def rolled(mesh: TriangleMesh) -> TriangleMesh:
    """The sheet about a cylinder, as long as it was."""
    x, _, z = mesh.vertices.T
    return TriangleMesh(np.column_stack([RADIUS * np.sin(x / RADIUS), RADIUS * np.cos(x / RADIUS), z]), mesh.faces)


def sagitta(edge: float) -> float:
    """How far the middle of a chord is from the circle [m]."""
    return RADIUS * (1 - np.cos(0.5 * edge / RADIUS))


@pytest.mark.parametrize("textured", [False, True])
def test_a_garment_of_few_triangles_bends_as_the_simulation_does(textured: bool) -> None:
    garment, sim = sheet(4), sheet(16)
    picture = np.zeros((4, 4, 3), np.uint8)
    given = TexturedMesh(garment, picture, np.ones((4, 4), bool)) if textured else garment
    (part,) = deform_render_mesh(given, sim, rolled(sim), DressConfig(), Job())
    middle = part.mesh.vertices[part.mesh.faces].mean(axis=1)
    off = RADIUS - np.linalg.norm(middle[:, :2], axis=1)
    assert off.max() < 1.01 * sagitta(0.6 / 16)  # a triangle's middle is nearer to the cylinder than a chord's
    assert off.max() < 0.1 * sagitta(0.6 / 4)
    assert part.uv is not None
    assert len(part.mesh.faces) == len(sim.faces)


def test_what_is_fine_enough_or_would_be_too_large_stays_as_it_is() -> None:
    garment, sim = sheet(4), sheet(16)
    assert as_fine_as(garment, sheet(5), 10_000) is garment
    assert as_fine_as(sim, garment, 10_000) is sim
    assert len(as_fine_as(garment, sim, 4 * len(garment.faces)).faces) == 4 * len(garment.faces)
    assert as_fine_as(garment, sim, 4 * len(garment.faces) - 1) is garment
