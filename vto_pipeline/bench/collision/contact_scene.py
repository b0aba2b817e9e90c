"""A scene in which cloth meets itself, and the figures of its last frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.collision.penetration import penetration
from vto_pipeline.bench.measures import edge_strain
from vto_pipeline.cloth.judge.crossings import self_crossings
from vto_pipeline.cloth.simulation import AnyCollider, Trajectory, simulate
from vto_pipeline.geometry.topology import face_areas
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class ContactScene:
    """A cloth that will meet itself.

    Args:
        name: Such as "sphere 32".
        mesh: Where it starts [m].
        rest: Its shape without forces [m], shape (V, 3).
        fabric: What it is made of.
        colliders: What else it may touch.
        seconds: How long it moves [s].
        pinned: Vertices that are held, or led.
        pin_path: Where those are at a time [s]: [m], shape (P, 3). Where they start when None.
        settings: Of `simulate`.
    """

    name: str
    mesh: TriangleMesh
    rest: FloatArray
    fabric: Fabric
    colliders: Sequence[AnyCollider]
    seconds: float
    pinned: Sequence[int] = ()
    pin_path: Callable[[float], FloatArray] | None = None
    settings: dict[str, Value] = field(default_factory=dict)

    def run(self, **settings: Value) -> Trajectory:
        """Return where it ends.

        Args:
            settings: Of `simulate`, over those of the scene.
        """
        return simulate(
            self.mesh,
            self.fabric,
            rest=self.rest,
            pinned=self.pinned,
            pin_path=self.pin_path,
            colliders=self.colliders,
            seconds=self.seconds,
            settings={**self.settings, **settings},
        )


def contact_errors(scene: ContactScene, ended: Trajectory) -> dict[str, Value]:
    """Return what the last frame shows.

    Returns:
        crossings: pairs of faces of the cloth that meet; penetration_mm: depth in the colliders; wrong_side: vertices
        in one; rms_stretch of the edges; mean_height_m; kinetic_j.
    """
    x = ended.positions
    mesh = TriangleMesh(x, scene.mesh.faces)
    strain = edge_strain(x, scene.rest, mesh.faces)
    area = face_areas(TriangleMesh(scene.rest, mesh.faces))
    mass = scene.fabric.areal_density * np.bincount(scene.mesh.faces.ravel(), np.repeat(area / 3.0, 3), len(x))
    moving = mass.copy()
    moving[list(scene.pinned)] = 0.0
    depths = [penetration(shape, mesh, scene.seconds) for shape in scene.colliders]
    return {
        "crossings": len(self_crossings(mesh)),
        "penetration_mm": 1e3 * max((found.deepest for found in depths), default=0.0),
        "wrong_side": sum(found.vertices for found in depths),
        "rms_stretch": float(np.sqrt(np.mean(strain**2))),
        "mean_height_m": float(mass @ x[:, 1] / mass.sum()),
        "kinetic_j": float(0.5 * moving @ (ended.velocities**2).sum(axis=1)),
    }
