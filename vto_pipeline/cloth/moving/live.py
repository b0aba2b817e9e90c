"""A draped garment that follows its body as fast as that moves: a step of Newton's method a frame, cut short.

The solver is that of `follow`. What makes it slow is left out: cloth may pass through itself, no step is cut at
what it would pass through or repeated, and a vertex is held off the part of the body that it lies on, not off others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.collision.contacts import ContactSpan
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.moving.live_body import LiveBody
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.cloth.solvers.newton import Limits, Newton
from vto_pipeline.geometry.riding.binding import apply, bind
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.mesh import TriangleMesh

_FAR_M = 0.1
"""Beyond it a vertex has no contact: no part of a body comes as near in a frame."""
_RECOVERY = 0.5  # m/s: speed at which cloth inside the body is led out
_ASTRAY_M = 1.0  # from the box about the body: farther, the cloth has blown up, or a body has jumped out of it


class LiveConfig(Materials):
    """How a garment follows a body live."""

    iterations: int = Field(2, ge=1, le=20, description="Newton iterations of a frame, at most")
    contact_rounds: int = Field(3, ge=1, le=20, description="Solutions of an iteration with revised contacts, at most")
    damping: float = Field(1.0, ge=0, le=1000, description="Decay rate of velocities, as by still air [1/s]")


class LiveCloth:
    """The garment.

    Args:
        garment: At rest on the body.
        body: What it is on.
        fabric: What it is made of.
        config: Settings, or keys of `LiveConfig`.

    Attributes:
        deepest: How deep a vertex has been in its part of the body so far [m].
        restarts: How often the garment was laid on the body anew, as it had gone astray.
    """

    _state: ClothState
    _body: LiveBody
    _solver: Newton

    def __init__(
        self,
        garment: Garment,
        body: TriangleMesh,
        fabric: Fabric,
        config: LiveConfig | Mapping[str, object] | None = None,
    ) -> None:
        self._config = checked(LiveConfig, config)
        self._model = build_cloth(garment.mesh, garment.rest, fabric, materials=self._config)
        self._skin = np.full(len(self._model.mass), default_skin(self._model.edge_length))
        self._laid, self._faces = bind(garment.mesh, body), body.faces
        self._friction = fabric.friction
        self.deepest = 0.0
        self.restarts = 0
        self._lay_on(body, garment.mesh.vertices)

    @property
    def positions(self) -> FloatArray:
        """Where it is [m], shape (V, 3)."""
        return self._state.positions

    def advance(self, vertices: FloatArray, seconds: float) -> None:
        """Go along with the body.

        Args:
            vertices: Where that is at the end of the frame [m], shape (B, 3).
            seconds: Length of the frame [s].
        """
        self._body.after = np.array(vertices)
        span = ContactSpan(0.0, seconds, _FAR_M, self._skin, _RECOVERY)
        contacts = self._body.contacts(self.positions, span)
        self.deepest = max(self.deepest, self._body.depth)
        self._state = self._solver.advance(self._state, contacts, seconds, 1)
        self._body.arrive()
        if self._is_near(vertices):
            self._state = replace(self._state, positions=self._body.led_out(self.positions))
        else:
            self.restarts += 1
            self._lay_on(TriangleMesh(vertices, self._faces), apply(self._laid, vertices))

    def _lay_on(self, body: TriangleMesh, positions: FloatArray) -> None:
        """Begin at rest on a body."""
        self._state = at_rest(positions)
        self._body = LiveBody(body, positions, self._friction)
        self._solver = Newton(self._model, damping=self._config.damping)
        self._solver.limits = Limits(self._config.iterations, self._config.contact_rounds, 0)

    def _is_near(self, vertices: FloatArray) -> bool:
        """Return whether all of the garment is where it can be."""
        low, high = vertices.min(axis=0) - _ASTRAY_M, vertices.max(axis=0) + _ASTRAY_M
        return bool(((self.positions > low) & (self.positions < high)).all())  # false for what is not a number
