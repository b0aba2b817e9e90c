"""Blender: its cloth modifier, springs and an implicit solver. Its licence is the GPL, so it is installed by hand.

Two peculiarities, seen by letting cloth fall freely, are put right here. A frame always lasts sqrt(0.001) s of its
physics, so `time_scale` makes it 1/60 s. Vertices lighter than about 0.01 kg fall wrongly, so each keeps the default
0.3 kg, and stiffness is scaled by as much: k = m ke / (l 0.3 0.001) in N/m, for a vertex of mass m and an edge l.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.cloth.scenes import FRICTION, RADIUS, STIFFNESS, Scene
from vto_pipeline.bench.timing import threads_now
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.units import GRAVITY

_MASS = 0.3  # of a vertex, by default [kg]
_TIME = 0.001  # s²; see the module
_GAP = 0.002  # distance kept [m]
_SLIDER = 100.0  # its friction is a slider of about a hundred times the coefficient
_BALL = {"segments": 96, "ring_count": 48}
_HELD = "held"


class _Modifier:
    """The scene in a Blender session of its own; the last two frames are kept for the velocity."""

    def __init__(self, scene: Scene, settings: Mapping[str, Value]) -> None:
        import bpy

        self._bpy: Any = bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._scene: Any = bpy.context.scene
        frames = round(scene.seconds / FRAME)
        self._scene.render.fps = round(1.0 / FRAME)
        self._scene.frame_start, self._scene.frame_end = 1, frames + 1
        self._scene.gravity = (0.0, -GRAVITY, 0.0)
        self._scene.render.threads_mode, self._scene.render.threads = "FIXED", threads_now()
        mesh = bpy.data.meshes.new("cloth")
        mesh.from_pydata(scene.start.tolist(), [], scene.model.faces.tolist())
        self._cloth: Any = bpy.data.objects.new("cloth", mesh)
        self._scene.collection.objects.link(self._cloth)
        self._dress(scene, settings, frames)
        if scene.ball is not None:
            bpy.ops.mesh.primitive_uv_sphere_add(radius=RADIUS, location=scene.ball, **_BALL)
            ball = bpy.context.object
            ball.modifiers.new("collision", "COLLISION")
            ball.collision.thickness_outer = 0.5 * _GAP
            ball.collision.cloth_friction = _SLIDER * FRICTION
            ball.collision.damping = 0.0
        self._scene.frame_set(1)
        self._before = self._now = self._positions()

    def frame(self) -> None:
        self._scene.frame_set(self._scene.frame_current + 1)
        self._before, self._now = self._now, self._positions()

    def state(self) -> ClothState:
        return ClothState(self._now, (self._now - self._before) / FRAME)

    def _dress(self, scene: Scene, settings: Mapping[str, Value], frames: int) -> None:
        modifier = self._cloth.modifiers.new("cloth", "CLOTH")
        cloth, collision = modifier.settings, modifier.collision_settings
        cloth.quality = int(str(settings["quality"]))
        cloth.mass, cloth.time_scale = _MASS, FRAME / _TIME**0.5
        stiffness = STIFFNESS * scene.model.edge_length * _MASS * _TIME / float(np.median(scene.model.mass))
        cloth.tension_stiffness = cloth.compression_stiffness = cloth.shear_stiffness = stiffness
        cloth.bending_model, cloth.bending_stiffness = "ANGULAR", 0.0
        for damping in ("air", "tension", "compression", "shear", "bending"):
            setattr(cloth, f"{damping}_damping", 0.0)
        held = np.flatnonzero(scene.model.inverse_mass == 0.0)
        if len(held):
            self._cloth.vertex_groups.new(name=_HELD).add(held.tolist(), 1.0, "REPLACE")
            cloth.vertex_group_mass = _HELD
        collision.use_collision = scene.ball is not None
        collision.use_self_collision = bool(settings["self_collision"])
        collision.distance_min = collision.self_distance_min = _GAP
        collision.friction = _SLIDER * FRICTION
        modifier.point_cache.frame_start, modifier.point_cache.frame_end = 1, frames + 1

    def _positions(self) -> FloatArray:
        mesh = self._cloth.evaluated_get(self._bpy.context.evaluated_depsgraph_get()).data
        flat = np.empty(3 * len(mesh.vertices))
        mesh.vertices.foreach_get("co", flat)
        return flat.reshape(-1, 3)


def start(scene: Scene, settings: Mapping[str, Value]) -> _Modifier:
    """Return the scene; settings: quality (its steps a frame), and whether cloth collides with itself."""
    return _Modifier(scene, settings)
