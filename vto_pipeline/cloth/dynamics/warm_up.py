"""Compile the kernels of a drape, or load them from the cache, before the clock starts."""

from __future__ import annotations

import time

import numpy as np

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

_SIDE = 52  # vertices; enough for the threaded kernels
_PATCH = 4  # vertices along a side of the other
_THICK = 1e-3  # m: two layers nearer than this touch


def warm_up() -> float:
    """Run steps of two small cloths, one on the other, over a moving triangle; return how long it took [s]."""
    began = time.perf_counter()
    cloth = _layers()
    fabric = Fabric("any", 0.1, _THICK, 1.0, 1.0, 1.0, 0.0, 1e-6, 1e-6, 0.0, 0.3, damping=1e-3)
    model = build_cloth(cloth, RestShape(cloth.vertices), fabric)
    below = TriangleMesh(np.array([[0, -0.1, 0], [0, -0.1, 1], [1, -0.1, 0]]), np.array([[0, 1, 2]], np.int32))
    body = MovingBody(np.stack([below.vertices, below.vertices + 0.01]), below.faces)
    collider = BodyCollider(body, FRAME, 0.3)
    config = StepConfig.model_validate({"substeps": 1, "sweeps": 2})
    stepper = Stepper(model, [collider], np.full(len(cloth.vertices), 1e-3), config)
    state = stepper.run(at_rest(cloth.vertices), FRAME)
    stepper.use_exact_stiffness(True)
    stepper.residual(stepper.run(state, FRAME))
    intersecting_faces(cloth, below)
    return time.perf_counter() - began


def _layers() -> TriangleMesh:
    """Return a flat square of side 1 and a small patch of the same mesh above it, half a cell aside."""
    under, over = _square(_SIDE), _square(_PATCH)
    raised = over.vertices * (_PATCH - 1) / (_SIDE - 1) + [0.3, 0.5 * _THICK, 0.3]
    faces = np.vstack([under.faces, over.faces + len(under.vertices)])
    return TriangleMesh(np.vstack([under.vertices, raised]), faces)


def _square(side: int) -> TriangleMesh:
    """Return a flat square of length 1 with side x side vertices."""
    x, z = np.meshgrid(np.linspace(0.0, 1.0, side), np.linspace(0.0, 1.0, side), indexing="ij")
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    faces = np.concatenate(
        [
            np.column_stack([corner, corner + 1, corner + side]),
            np.column_stack([corner + 1, corner + side + 1, corner + side]),
        ]
    )
    return TriangleMesh(np.column_stack([x.reshape(-1), np.zeros(side * side), z.reshape(-1)]), faces.astype(np.int32))
