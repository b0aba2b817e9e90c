"""Measurements of any body: an avatar directly, another mesh through the avatar registered to it."""

from __future__ import annotations

from vto_pipeline.avatar.from_scan import fit_scan
from vto_pipeline.avatar.measuring.avatar_measurements import measure_avatar
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.mesh import TriangleMesh


def measure(body: Avatar | TriangleMesh) -> Measurements:
    """Measure our body in its bind pose, or any other after registering ours to it.

    Args:
        body: An avatar, or a mesh of a body in metres, +Y up.

    Returns:
        What `measure_avatar` returns.

    Raises:
        AvatarError: the mesh is not a body that can be registered.
    """
    return measure_avatar(fit_scan(body) if isinstance(body, TriangleMesh) else body)
