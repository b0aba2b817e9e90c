"""No skin between the vertices of a coarse cloth, and seams of its picture stay closed."""

from __future__ import annotations

from pathlib import Path

import igl
import numpy as np
import pytest
import trimesh

from vto_pipeline.geometry.remeshing.decimate import decimate
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.render.clear_body import cut_by_body, outside
from vto_pipeline.render.dress import BODY as BODY_PART

BODY = Path(__file__).parents[2].parent / "shared" / "data" / "bodies" / "mh_female_averageweight.ply"
RADIUS = 0.1


def ball() -> TriangleMesh:
    made = trimesh.creation.icosphere(5, RADIUS)
    return TriangleMesh(made.vertices, made.faces)


def cage() -> trimesh.Trimesh:
    """Triangles of 28 mm, whose corners lie 0.8 mm off the ball: their middles cut into it."""
    return trimesh.creation.icosphere(2, RADIUS + 8e-4)


def inside(vertices: np.ndarray, faces: np.ndarray, body: TriangleMesh) -> int:
    """Return how many of many points on the triangles lie in a body, by another library."""
    weights = np.array([(i, j, 5 - i - j) for i in range(6) for j in range(6 - i)]) / 5.0
    points = np.einsum("pk,fkj->fpj", weights, vertices[faces]).reshape(-1, 3)
    winding = igl.fast_winding_number(np.array(body.vertices), np.array(body.faces, dtype=np.int64), points)
    return int((winding > 0.5).sum())


def test_no_point_of_a_coarse_cloth_is_inside() -> None:
    """The ball is round: what is inside is nearer to its centre than the radius, but for its own chords."""
    made = cage()
    (clear,) = outside([TriangleMesh(made.vertices, made.faces)], ball())
    least, before = (trimesh.Trimesh(v, made.faces, process=False).triangles_center for v in (clear, made.vertices))
    assert np.linalg.norm(before, axis=1).min() < RADIUS - 5e-4
    assert np.linalg.norm(least, axis=1).min() > RADIUS - 1e-4
    assert np.linalg.norm(clear, axis=1).max() < RADIUS + 8e-4 + 3e-3  # raised by no more than it takes


def test_what_does_not_touch_stays_where_it_is() -> None:
    far = trimesh.creation.icosphere(2, RADIUS + 5e-3)
    (clear,) = outside([TriangleMesh(far.vertices, far.faces)], ball())
    assert np.array_equal(clear, far.vertices)


def test_both_sides_of_a_seam_are_raised_together() -> None:
    made = cage()
    apart = TriangleMesh(made.vertices[made.faces].reshape(-1, 3), np.arange(3 * len(made.faces)).reshape(-1, 3))
    whole, cut = (outside([one], ball())[0] for one in (TriangleMesh(made.vertices, made.faces), apart))
    assert np.array_equal(cut.reshape(-1, 3, 3), whole[made.faces])


def test_what_still_cuts_the_body_is_counted() -> None:
    """A sheet through a ball's middle: its triangles cut whose nearest and farthest points lie on both sides."""
    across = np.linspace(-0.15, 0.15, 16) + 0.0031
    x, z = np.meshgrid(across, across, indexing="ij")
    corner = np.arange(256).reshape(16, 16)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    sheet = TriangleMesh(
        np.column_stack([x.ravel(), np.zeros(256), z.ravel()]),
        np.vstack([np.column_stack(t) for t in ((a, b, c), (a, c, d))]),
    )
    corners = sheet.vertices[sheet.faces]
    nearest = np.linalg.norm(trimesh.triangles.closest_point(corners, np.zeros((len(corners), 3))), axis=1)
    farthest = np.linalg.norm(corners, axis=2).max(axis=1)
    cut = (nearest < RADIUS) & (farthest > RADIUS)
    assert np.abs(np.concatenate([nearest, farthest]) - RADIUS).min() > 1e-4  # the ball's triangles lie nearer to it
    worn, body = GlbPart("garment", sheet), GlbPart(BODY_PART, ball())
    assert cut_by_body([worn, body]) == cut.sum() > 20
    assert cut_by_body([worn]) == 0


@pytest.mark.real_data
@pytest.mark.skipif(not BODY.exists(), reason="the data by others are not there")
def test_no_skin_shows_through_cloth_on_a_person() -> None:
    """A body's own surface as cloth, of fewer triangles: what is sharp on it came through."""
    body = read_mesh(BODY)
    x, y, _ = body.vertices.T
    trunk = (np.abs(x) < 0.2) & (y > 0.9) & (y < 1.3)  # between the groin and the armpits
    cloth = decimate(submesh(body, trunk[body.faces].all(axis=1))[0], 1000)
    (clear,) = outside([cloth], body)
    before = inside(cloth.vertices, cloth.faces, body)
    assert before > 1000
    assert inside(clear, cloth.faces, body) == 0
