"""A garment, the body it is cut for, its fabric, and the figures of its drape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.samples.garments.wardrobe import WARDROBE
from vto_pipeline.bench.samples.garments.wearer import Wearer, wearer
from vto_pipeline.cloth.drape import drape
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.cloth import Draped, seconds_within
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job

STAND: Mapping[str, Value] = {"place": "as_it_stands", "settle_seconds": 20.0}
"""Settings of every drape here: garments are made where they belong, and only the predicted error ends a run."""


@dataclass(frozen=True)
class DrapeCase:
    """A garment on the body it is cut for.

    Args:
        garment: One of `samples.wardrobe.WARDROBE`.
        size: One of `samples.wearer.SIZES`.
        fabric: A preset.
        edge_mm: Length of the edges [mm].
    """

    garment: str
    size: str
    fabric: str
    edge_mm: float

    @property
    def name(self) -> str:
        """Such as "skirt, slim, denim"."""
        return f"{self.garment}, {self.size}, {self.fabric}"

    @property
    def wearer(self) -> Wearer:
        """Who wears it."""
        return wearer(self.size)

    def made(self) -> Garment:
        """Return the garment before it is draped."""
        return _made(self.garment, self.size, self.edge_mm)

    def drape(self, settings: Mapping[str, Value], fabric: Fabric | None = None, job: Job | None = None) -> Draped:
        """Return the garment at rest.

        Args:
            settings: Over `STAND`.
            fabric: In place of the preset.
            job: For what was left out.
        """
        cloth = read_fabric(self.fabric) if fabric is None else fabric
        return drape(self.made(), self.wearer.avatar.mesh, cloth, {**STAND, **settings}, job)


def findings(found: Draped) -> dict[str, Value]:
    """Return what the judge says, what the drape itself predicts, and when it was in truth within 1 mm of its end.

    predicted_mm is still to come.
    """
    words = {
        "finite": "finite",
        "settled": "settled",
        "body_crossings": "body_intersections",
        "self_crossings": "self_intersections",
        "max_stretch": "max_stretch",
        "residual": "residual",
    }
    audit = {ours: _value(found.audit[theirs]) for ours, theirs in words.items()}
    predicted = found.trace[-1].error_mm if found.trace else float("inf")
    return {"predicted_mm": predicted, "within_1_mm_s": seconds_within(found.trace, 1.0), **audit}


def _value(value: object) -> Value:
    assert isinstance(value, float | int | bool)
    return value


@cache
def _made(garment: str, size: str, edge_mm: float) -> Garment:
    return WARDROBE[garment](wearer(size), edge_mm)
