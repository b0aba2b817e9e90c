"""Several garments worn in layers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class Layer:
    """One garment of several.

    Args:
        name: Of the garment, for people and for its files.
        garment: Its simulation mesh where it is now, and its rest shape.
        fabric: What it is made of.
    """

    name: str
    garment: Garment
    fabric: Fabric


@dataclass(frozen=True)
class DrapedOutfit:
    """Garments on a body, in layers.

    Args:
        meshes: Name -> the garment's simulation mesh at its end [m]; inner first.
        trace: Error against run time of all together.
        audit: Of all together, with that of each garment under "layers"; plain JSON values.
    """

    meshes: Mapping[str, TriangleMesh]
    trace: Sequence[TraceRow]
    audit: Mapping[str, object]
