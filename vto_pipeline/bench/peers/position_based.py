"""PositionBasedDynamics: XPBD distance constraints, Gauss-Seidel over coloured groups; vertices against a ball."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.cloth.scenes import FRICTION, POISSON, RADIUS, STIFFNESS, Scene
from vto_pipeline.bench.timing import threads_now
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.model.build import ClothState

_XPBD_DISTANCE = 4  # the library's number of the cloth model
_TOLERANCE = 0.01  # distance at which a vertex meets the ball [m]
_VELOCITY_ITERATIONS = 5
_CONTACT_STIFFNESS = 100.0
_HEAVY = 1000.0  # density of the ball, which is then held [kg/m³]


class _Particles:
    """The scene in the library's one simulation."""

    def __init__(self, scene: Scene, settings: Mapping[str, Value]) -> None:
        os.environ.setdefault("OMP_NUM_THREADS", str(threads_now()))  # read when the library is loaded
        import pypbd

        self._count = len(scene.start)
        if pypbd.Simulation.hasCurrent():
            pypbd.Simulation.getCurrent().getModel().cleanup()
        simulation = pypbd.Simulation.getCurrent()
        simulation.initDefault()
        self._model: Any = simulation.getModel()
        cloth = self._model.addTriangleModel(
            list(scene.rest), scene.model.faces.ravel().tolist(), testMesh=scene.ball is not None
        )
        self._particles: Any = self._model.getParticles()
        for vertex, (mass, inverse) in enumerate(zip(scene.model.mass, scene.model.inverse_mass, strict=True)):
            self._particles.setMass(vertex, mass if inverse > 0.0 else 0.0)
        stiffness = [STIFFNESS] * 4  # of a spring along a square grid's edge [N/m]: the sheet's own
        self._model.addClothConstraints(cloth, _XPBD_DISTANCE, *stiffness, POISSON, POISSON, False, False)
        self._stepper: Any = simulation.getTimeStep()
        if scene.ball is not None:
            self._kept = self._ball(pypbd, simulation, cloth)
        controller = pypbd.TimeStepController
        self._stepper.setValueUInt(controller.NUM_SUB_STEPS, 1)
        self._stepper.setValueUInt(controller.MAX_ITERATIONS, 1)
        self._stepper.setValueUInt(controller.MAX_ITERATIONS_V, _VELOCITY_ITERATIONS)
        self._steps = int(str(settings["substeps"]))
        pypbd.TimeManager.getCurrent().setTimeStepSize(FRAME / self._steps)
        for vertex, place in enumerate(scene.start):
            self._particles.setPosition(vertex, place)

    def frame(self) -> None:
        for _ in range(self._steps):
            self._stepper.step(self._model)

    def state(self) -> ClothState:
        positions = np.array(self._particles.getVertices()).reshape(-1, 3)[: self._count].copy()
        velocities = np.array([self._particles.getVelocity(vertex) for vertex in range(self._count)])
        return ClothState(positions, velocities)

    def _ball(self, pypbd: Any, simulation: Any, cloth: Any) -> tuple[Any, ...]:
        """Put the ball in as a held body with a distance field; return what must stay alive."""
        import trimesh

        shape = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
        points = pypbd.VertexData()
        for point in shape.vertices:
            points.addVertex(point)
        surface = pypbd.IndexedFaceMesh()
        surface.initMesh(len(shape.vertices), len(shape.edges_unique), len(shape.faces))
        for face in shape.faces:
            surface.addFace([int(corner) for corner in face])
        surface.buildNeighbors()
        body = self._model.addRigidBody(_HEAVY, points, surface, testMesh=False)
        body.setMass(0.0)
        for one in (body, cloth):  # the library adds the two up
            one.setFrictionCoeff(0.5 * FRICTION)
            one.setRestitutionCoeff(0.0)
        detection = self._stepper.getCollisionDetection()
        if detection is None:
            detection = pypbd.DistanceFieldCollisionDetection()
            self._stepper.setCollisionDetection(self._model, detection)
        detection.setTolerance(_TOLERANCE)
        kinds = pypbd.CollisionObject
        placed = body.getGeometry().getVertexData()
        detection.addCollisionSphere(
            0, kinds.RigidBodyCollisionObjectType, placed, 0, len(shape.vertices), RADIUS, False, False
        )
        detection.addCollisionObjectWithoutGeometry(
            0, kinds.TriangleModelCollisionObjectType, self._particles, 0, self._count, True
        )
        self._model.setContactStiffnessParticleRigidBody(_CONTACT_STIFFNESS)
        return points, surface, body, detection


def start(scene: Scene, settings: Mapping[str, Value]) -> _Particles:
    """Return the scene; settings: substeps a frame."""
    return _Particles(scene, settings)
