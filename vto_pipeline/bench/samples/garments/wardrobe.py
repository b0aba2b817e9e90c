"""The sample garments by name."""

from __future__ import annotations

from collections.abc import Callable

from vto_pipeline.bench.samples.garments.skirt import make_skirt
from vto_pipeline.bench.samples.garments.top import make_dress, make_shirt
from vto_pipeline.bench.samples.garments.trousers import make_trousers
from vto_pipeline.bench.samples.garments.wearer import Wearer
from vto_pipeline.model.garment import Garment

WARDROBE: dict[str, Callable[[Wearer, float], Garment]] = {
    "shirt": make_shirt,
    "dress": make_dress,
    "skirt": make_skirt,
    "trousers": make_trousers,
}
"""Name -> how it is made for a wearer, with edges of so many mm."""
