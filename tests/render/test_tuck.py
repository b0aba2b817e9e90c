"""A lifelike body under cloth: inside what the cloth was draped on, and elsewhere as it is."""

from __future__ import annotations

import numpy as np
import trimesh

from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.tuck import innermost, tuck


def ball(radius: float) -> TriangleMesh:
    found = trimesh.creation.icosphere(4, radius)
    return TriangleMesh(found.vertices, found.faces.astype(np.int32))


def bumpy() -> TriangleMesh:
    """A ball of 10 cm whose two poles stand out by 15 mm, as ears do."""
    plain = ball(0.1)
    out = 1 + 0.15 * np.exp(-((1 - np.abs(plain.vertices[:, 1]) / 0.1) / 0.05))
    return TriangleMesh(plain.vertices * out[:, None], plain.faces)


def cap(sign: float) -> TriangleMesh:
    cloth = ball(0.104)
    keep = (sign * cloth.vertices[cloth.faces][..., 1] > 0.03).all(axis=1)
    return TriangleMesh(cloth.vertices, cloth.faces[keep])


def test_what_cloth_covers_lies_inside_and_what_is_bare_stays() -> None:
    body, avatar = bumpy(), ball(0.1)
    tucked = tuck(body, avatar, [cap(1.0)]).vertices
    radius = np.linalg.norm(tucked, axis=1)
    assert radius[body.vertices[:, 1] > 0.06].max() < 0.1001  # what is nearer than that to the avatar is its own
    bare = body.vertices[:, 1] < -0.02
    assert np.array_equal(tucked[bare], body.vertices[bare])
    assert np.linalg.norm(body.vertices, axis=1).max() > 0.114


def test_no_cloth_changes_nothing() -> None:
    body = bumpy()
    assert np.array_equal(tuck(body, ball(0.1), []).vertices, body.vertices)


def test_under_two_garments_each_place_is_as_far_in_as_either_has_it() -> None:
    body, avatar = bumpy(), ball(0.1)
    both = innermost([tuck(body, avatar, [cap(1.0)]), tuck(body, avatar, [cap(-1.0)])], vertex_normals(body))
    at_once = tuck(body, avatar, [cap(1.0), cap(-1.0)])
    radius, wanted = (np.linalg.norm(one.vertices, axis=1) for one in (both, at_once))
    assert radius.max() < 0.1015
    np.testing.assert_allclose(radius, wanted, rtol=0, atol=1e-3)  # where both caps are near, they fade together
