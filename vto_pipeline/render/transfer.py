"""Binding of the render mesh to the simulation mesh."""

from __future__ import annotations

from vto_pipeline.geometry.riding import binding
from vto_pipeline.geometry.riding.binding import Binding, apply
from vto_pipeline.model.mesh import TriangleMesh

__all__ = ["Binding", "apply", "bind"]


def bind(render_mesh: TriangleMesh, sim_mesh: TriangleMesh) -> Binding:
    """Bind a render mesh to the simulation mesh it was made from or that was made from it.

    Args:
        render_mesh: In the pose of `sim_mesh` [m].
        sim_mesh: What will move.
    """
    return binding.bind(render_mesh, sim_mesh)
