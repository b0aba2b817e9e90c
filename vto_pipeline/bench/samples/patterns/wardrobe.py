"""The sample patterns by name."""

from __future__ import annotations

from collections.abc import Callable

from vto_pipeline.bench.samples.patterns.bottoms import skirt, trousers
from vto_pipeline.bench.samples.patterns.tape import Tape
from vto_pipeline.bench.samples.patterns.tops import dress, jacket, shirt, tee
from vto_pipeline.model.pattern import Pattern

PATTERNS: dict[str, Callable[[Tape], Pattern]] = {
    "tee": tee,
    "skirt": skirt,
    "trousers": trousers,
    "shirt": shirt,
    "dress": dress,
    "jacket": jacket,
}
"""Name -> how it is cut to a tape."""
