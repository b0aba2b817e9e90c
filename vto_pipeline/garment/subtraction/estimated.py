"""Label the garment over a mannequin that was never scanned bare: colour carries what distance cannot.

A body fitted into a dressed scan is off by a centimetre or two, more than tight cloth lies above it. It tells where
head, hands and feet are. What shows there is bare, and teaches the mannequin's colours.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.subtraction.color_model import color_evidence, color_overlap
from vto_pipeline.garment.subtraction.floor import not_worn
from vto_pipeline.garment.subtraction.graph_cut import minimum_cut
from vto_pipeline.garment.subtraction.subtract import CERTAIN, SubtractConfig, boundary_price
from vto_pipeline.geometry.apart import faces_apart
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

SIGMA = 0.012
"""Standard deviation of an estimated body's surface [m]: the bare parts of four dressed scans had 6 to 9 mm."""
LOOSE = 0.05
"""Cloth is as dense close to the body as if it were spread evenly over this distance [m]."""
FAR = 2.5 * SIGMA
"""Farther than this from the body is nothing of it [m]."""
FOOT = 0.15
"""The floor may lie so much higher than the estimated feet, of which a scan may show nothing [m]."""
ENOUGH = 0.01
"""Least share of what stands that head, hands and feet must be to teach the mannequin's colours."""
ALIKE = 0.5
"""Largest overlap of the colours of head, hands and feet with those of what was found to be cloth: 0.35 at most
where they differ, and 0.99 of white cloth on a white form."""
BINS, LIGHT = 48, 5.0
"""Of the histograms, and how far lightness is smoothed [bins]: cloth and mannequin may differ by 10 in CIELAB, and what
is bare lies in other light than the hands."""
ROUNDS = 2
"""Of labels and colours: what was found bare teaches the colours of other light."""


def label_over_estimate(
    surface: TriangleMesh, body: TriangleMesh, ends: FloatArray, config: SubtractConfig, job: Job
) -> SurfaceLabels:
    """Divide the scan into garment and the rest, by colour and by the distance to a body that was only estimated.

    Args:
        surface: The dressed scan, +Y up [m].
        body: Estimated inside it.
        ends: How much each of the body's vertices belongs to head, hands and feet, 0 to 1, shape (V,).
        config: Settings.
        job: Receives the shares.

    Raises:
        GarmentError: too little of the mannequin is bare, or its colours are those of the cloth.
    """
    if surface.colors is None:
        raise GarmentError("without a scan of the bare mannequin, the scan needs colours", hint=_HINT)
    near = SurfaceDistance(body).signed(surface.vertices)
    standing = ~not_worn(surface, float(body.vertices[:, 1].min()) + FOOT, SIGMA / 3.0, job)
    standing[surface.faces[faces_apart(surface, np.abs(near.distance))]] = False
    at_ends = ends[body.faces].mean(axis=1)[near.face] > 0.5
    bare = sure = at_ends & (np.abs(near.distance) < FAR) & standing
    share = float(sure.sum() / max(standing.sum(), 1))
    job.measure(bare_ends_share=share)
    if not ENOUGH <= share < 1.0:
        raise GarmentError(
            f"head, hands and feet are only {share:.1%} of the scan; at least {ENOUGH:.0%} must show their colour",
            hint=_HINT,
        )
    by_distance = _distance_evidence(near.distance)
    for _ in range(ROUNDS):
        by_color = -color_evidence(surface.colors, bare, standing & ~bare, BINS, LIGHT)
        evidence = by_distance + np.clip(by_color, -CERTAIN, CERTAIN)
        evidence = np.where(sure, np.minimum(evidence, -CERTAIN), evidence)
        evidence = np.where(standing, evidence, -4.0 * CERTAIN)
        garment = minimum_cut(evidence, edges(surface), boundary_price(surface, config))
        bare = standing & ~garment & (np.abs(near.distance) < FAR)
    alike = color_overlap(surface.colors, sure, standing & garment, BINS, LIGHT)
    job.measure(colors_alike=alike, garment_share=float(garment.mean()))
    if alike > ALIKE:
        raise GarmentError(
            f"cloth and mannequin have nearly the same colours: they overlap by {alike:.0%}; at most {ALIKE:.0%} "
            "is allowed",
            hint=_HINT,
        )
    job.warn("the mannequin was not scanned bare: colour parts cloth and body")
    confidence = 1.0 / (1.0 + np.exp(-np.where(garment, evidence, -evidence)))
    return SurfaceLabels(garment, confidence)


_HINT = "scan the mannequin without the garment, and give that scan"


def _distance_evidence(distance: FloatArray) -> FloatArray:
    """Return the log-likelihood ratio of cloth, evenly spread outside, against the body's own surface."""
    bare = np.square(distance / SIGMA)
    cloth = np.square(np.minimum(distance / SIGMA, 0.0))
    return np.clip(0.5 * (bare - cloth) - np.log(LOOSE / SIGMA), -CERTAIN, CERTAIN)
