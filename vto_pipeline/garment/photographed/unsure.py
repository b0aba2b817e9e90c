"""Long loops of which neither the photos nor the scan tell for certain whether they are openings, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.loop_evidence import LoopShape, disc_of, encloses
from vto_pipeline.garment.photographed.covered import BARE, COVERED
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray

LONG = 0.3
"""Shorter fillings hide no opening for a head or a leg [m]."""
SEEN_BARE = 0.95
"""Through an opening that the mannequin fills, but does not come out of, such a share of it was seen bare: a form's
neck ends in the collar. Cloth that lies close was taken for bare over a quarter of a hole at most."""
FILLED = 0.9
"""The mannequin fills such a share of the disc of a loop that goes round its end; of holes over a shoulder, half."""
ADVICE = "take more frames or photos that look squarely into it, or look at it and set openings.keep"


def unsure_loops(
    loops: Sequence[LoopShape],
    rims: Sequence[FloatArray],
    is_opening: Sequence[bool],
    shares: Sequence[float | None],
    distance: SurfaceDistance,
    bare: BareParts | None,
    reach: float,
) -> list[str]:
    """Return what must be said of long loops.

    One that was filled may be an opening where cloth was seen to end along it, or where the mannequin fills it and was
    seen neither bare nor clothed. One that is open may go on elsewhere than it does, where only its edge was seen.

    Args:
        loops: Of the garment, L of them.
        rims: Each in order [m], shape (N, 3).
        is_opening: What each was taken for.
        shares: How much of what photos show through each is cloth; None where they do not tell.
        distance: Signed distances to the mannequin [m].
        bare: What was scanned of the bare mannequin; None where that is not known.
        reach: How far inside of an opening the mannequin may end [m].
    """
    said = []
    for loop, rim, real, cloth in zip(loops, rims, is_opening, shares, strict=True):
        if loop.perimeter < LONG or (cloth is not None and (cloth < BARE if real else cloth > COVERED)):
            continue
        if real and encloses(rim, distance, reach):
            continue
        x, y, z = loop.center
        what = f"of {1e3 * loop.perimeter:.0f} mm at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        disc = disc_of(rim)
        seen_bare = (cloth is not None and cloth < BARE) or (
            bare is not None and float(np.mean(bare.under(disc))) > SEEN_BARE
        )
        along = 0.0 if bare is None else 1e3 * bare.ends_cloth(rim) * loop.perimeter
        if real and along > 0.0 and not seen_bare:
            said.append(
                f"the opening {what} is uncertain: cloth was seen to end along {along:.0f} mm of it, and little of the "
                f"mannequin was seen through it; {ADVICE}"
            )
        elif not real and along > 0.0:
            said.append(
                f"a hole {what} was filled, but cloth was seen to end along {along:.0f} mm of it: it may be "
                f"an opening; {ADVICE}"
            )
        elif not real and not seen_bare and float(np.mean(distance.inside(disc))) > FILLED:
            said.append(
                f"a hole {what} was filled, though the mannequin fills it, too: neither cloth nor bare mannequin was "
                f"seen there for certain, and it may be an opening; {ADVICE}"
            )
    return said
