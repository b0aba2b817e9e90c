"""Several garments as one cloth, each with its own rest shape and fabric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan
from vto_pipeline.cloth.dynamics.body_motion import VariableSpeedBody
from vto_pipeline.cloth.model.build import ClothModel, build_cloth
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.outfit import Layer

_APART = 10.0  # m between rest shapes: what is near at rest is not looked at where it is near when worn


class CombinedCloth(NamedTuple):
    """Garments as one cloth.

    Args:
        model: Of all.
        models: Of each, by the vertices of all; it has no mass at those of others.
        mesh: Of all, where they are now.
        rest: Of all, side by side.
        vertices: Those of each.
    """

    model: ClothModel
    models: tuple[ClothModel, ...]
    mesh: TriangleMesh
    rest: RestShape
    vertices: tuple[slice, ...]


def combine_garments(layers: Sequence[Layer], materials: Materials) -> CombinedCloth:
    """Return these garments as one cloth.

    Raises:
        InputError, ConfigError: as `build_cloth`.
    """
    first = np.cumsum([0, *(len(layer.garment.mesh.vertices) for layer in layers)])
    own = tuple(slice(int(begin), int(end)) for begin, end in pairwise(first))
    positions = np.vstack([layer.garment.mesh.vertices for layer in layers])
    aside = np.array([_APART, 0.0, 0.0])
    rest = np.vstack([layer.garment.rest.positions + k * aside for k, layer in enumerate(layers)])
    models = []
    for layer, span in zip(layers, own, strict=True):
        mesh = TriangleMesh(positions, layer.garment.mesh.faces + np.int32(span.start))
        shape = replace(layer.garment.rest, positions=rest)
        models.append(build_cloth(mesh, shape, layer.fabric, materials=materials, job=Job()))
    faces = np.vstack([model.faces for model in models])

    def parts(name: str) -> FloatArray:
        return np.concatenate([getattr(model, name)[span] for model, span in zip(models, own, strict=True)])

    model = ClothModel(
        faces=faces,
        mass=parts("mass"),
        inverse_mass=parts("inverse_mass"),
        constraints=tuple(data for one in models for data in one.constraints),
        edge_length=min(one.edge_length for one in models),
        gravity=models[0].gravity,
        reach=parts("reach"),
        friction=parts("friction"),
    )
    return CombinedCloth(model, tuple(models), TriangleMesh(positions, faces), RestShape(rest), own)


class MultiFrictionBody(VariableSpeedBody):
    """A body at rest on which fabrics of different friction lie.

    Args:
        body: Where it is [m].
        friction: Coulomb coefficient of each vertex of the cloth against it, shape (V,).
        job: For what was repaired and left out.
    """

    def __init__(self, body: TriangleMesh, friction: FloatArray, job: Job) -> None:
        super().__init__(MovingBody(body.vertices[None], body.faces), 0.0, float(friction.max()), job)
        self._kinds = np.unique(friction)
        self._of_kind = friction == self._kinds[:, None]

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`; each plane once for each coefficient, touched by the vertices that have it."""
        found = super().contacts(positions, span)
        active = found.active[:, None] & self._of_kind
        point, normal, offset = (
            np.repeat(part, len(self._kinds), axis=0) for part in (found.point, found.normal, found.offset)
        )
        return Contacts(
            active.reshape(len(offset), -1), point, normal, offset, np.tile(self._kinds, len(found.friction))
        )
