"""Subtract the mannequin: label the garment in the scan and extract its open shell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.special import ndtr

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.alignment.robust_icp import scan_noise
from vto_pipeline.garment.subtraction.color_model import cielab, color_evidence
from vto_pipeline.garment.subtraction.floor import is_level, not_worn
from vto_pipeline.garment.subtraction.graph_cut import minimum_cut
from vto_pipeline.garment.subtraction.thin_parts import thin_parts
from vto_pipeline.garment.subtraction.variety import surface_variety, variety_evidence
from vto_pipeline.geometry.remeshing.clip import clip_to_positive
from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.smooth import smooth_values
from vto_pipeline.geometry.topology import (
    component_areas,
    edges,
    face_normals,
    submesh,
    vertex_normals,
)
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

CERTAIN = 6.0
"""Log-likelihood ratio up to which colour is believed, and the distance of what lies close; far cloth counts double."""
TIGHT = 0.007
"""Cloth is as dense close to the mannequin as if it were spread evenly over this distance [m]."""
LEAST_SIGMA = 1e-4
"""Scans claim to be better than this only by accident [m]."""
MOST_SIGMA = 5e-3
THICKENED, SELDOM, THICKER = 0.1, 0.003, 3e-3
"""These shares of the thin parts of the bare mannequin, and of its trunk, are scanned with errors of so many metres
(standard deviation), whatever the noise of the rest: fingers and arms come out too thick. Only colour can tell such
places from tight cloth. On the trunk, distance outweighs colours in doubt: a strap's are mixed with the skin's."""
SURELY_BARE, FACING = 2.0, 0.7
"""What lies no deeper inside than so many deviations of the noise, and faces as the mannequin (cosine), is bare."""
PRESSED = 0.5
"""Cloth that is pressed on the mannequin may be such a share of what passes for bare, whatever the distances say."""
SURE, TOLD = 1.0, 0.8
"""How colours vary counts where so much of either side has such a log-likelihood ratio or more."""
FLOOR_REACH = 0.01
"""A board on the floor may lie so much higher than the lowest point of the mannequin [m]."""


class SubtractConfig(Config):
    """Settings that separate the garment from the mannequin."""

    thickness_mm: float = Field(0.5, ge=0, le=20, description="Cloth thickness: cloth lies at least this far out [mm]")
    smoothness: float = Field(2.0, ge=0, le=100, description="Cost of a label boundary, per edge of mean length")
    color_step: float = Field(15.0, gt=0, le=200, description="CIELAB difference at which a boundary costs 1/e")
    smallest_piece_cm2: float = Field(20.0, ge=0, le=10_000, description="Smaller garment pieces are dropped [cm²]")


def label_garment(surface: TriangleMesh, mannequin: TriangleMesh, config: SubtractConfig, job: Job) -> SurfaceLabels:
    """Divide the scan into garment and the rest by an exact graph cut.

    Evidence per vertex: the signed distance against the noise measured on the bare parts, the colour, and whether
    the normal agrees with the mannequin's. Where cloth is printed, so that colours vary from place to place as they
    do on no form, it is cut once more with that. What looks as plain as half of the form does then tells how far
    the form is scanned outward, too, which may be much less than inward: as near as cloth lies to it. The form's
    colours are those of what lies just inside of it, where no cloth can be: as far outside, tight cloth may be most
    of what there is. A boundary is cheap where the colour changes. The level surface that the scan stands on is
    floor or board; cloth that hangs below the mannequin is cloth.

    Args:
        surface: The scan in the mannequin's frame.
        mannequin: The mannequin under the garment.
        config: Settings.
        job: Receives the noise and the shares.

    Raises:
        GarmentError: nothing of the scan stands off from the mannequin.
    """
    near = SurfaceDistance(mannequin).signed(surface.vertices)
    facing = np.einsum("vd,vd->v", vertex_normals(surface), face_normals(mannequin)[near.face])
    sigma = float(np.clip(scan_noise(near.distance, 4.0 * MOST_SIGMA), LEAST_SIGMA, MOST_SIGMA))
    floor = not_worn(surface, float(mannequin.vertices[:, 1].min()) + FLOOR_REACH, sigma, job)
    thickness = config.thickness_mm * 1e-3
    sure_garment = (near.distance > thickness + 3.0 * sigma) & ~floor
    sure_bare = (near.distance < 0.0) & (near.distance > -SURELY_BARE * sigma) & (facing > FACING) & ~floor
    if not sure_garment.any():
        raise GarmentError(
            f"no part of the scan stands off from the mannequin by more than {(thickness + 3 * sigma) * 1e3:.1f} mm",
            hint="is the garment on the mannequin, and the scan aligned?",
        )
    by_color, thickened, mixed = None, None, 1.0
    if surface.colors is None:
        job.leave_out("colour evidence", "the scan has no colours")
    elif not sure_bare.any():
        job.leave_out("colour evidence", "no bare mannequin shows")
    else:
        facing_out = near.distance[(facing > FACING) & ~floor]
        mixed = most_mixed(facing_out, sigma, thickness)
        by_color = color_evidence(surface.colors, sure_garment, sure_bare, most_mixed=mixed)
        thickened = np.where(thin_parts(mannequin), THICKENED, SELDOM)[near.face]
    pair, price = edges(surface), boundary_price(surface, config)

    def cut(outward: float, by_look: FloatArray | float) -> tuple[FloatArray, NDArray[np.bool_]]:
        by_distance = _distance_evidence(near.distance, sigma, outward, thickness, thickened)
        by_distance = np.where(facing < 0.0, np.maximum(by_distance, CERTAIN / 2.0), by_distance)
        evidence = np.where(floor, -4.0 * CERTAIN, by_distance + np.clip(by_look, -CERTAIN, CERTAIN))
        return evidence, minimum_cut(evidence, pair, price)

    evidence, garment = cut(sigma, 0.0 if by_color is None else by_color)
    if by_color is not None:
        by_variety = variety_evidence(surface_variety(surface, garment), sure_garment, sure_bare, mixed)
        of_cloth, of_form = np.mean(by_variety[sure_garment] > SURE), np.mean(by_variety[sure_bare] < -SURE)
        if min(of_cloth, of_form) >= TOLD:
            plain = by_variety <= np.median(by_variety[sure_bare])
            outward = scan_noise(-near.distance[plain & (facing > FACING) & ~floor], 4.0 * MOST_SIGMA)
            outward = float(np.clip(outward, LEAST_SIGMA, sigma))
            evidence, garment = cut(outward, by_color + by_variety)
            job.measure(noise_outward_mm=outward * 1e3)
            job.note(f"a print: how colours vary tells {of_cloth:.0%} of the cloth, and {of_form:.0%} of the form")
        else:
            job.leave_out("evidence by how colours vary", "it does not tell cloth from form")
    job.measure(noise_mm=sigma * 1e3, garment_share=float(garment.mean()))
    confidence = 1.0 / (1.0 + np.exp(-np.where(garment, evidence, -evidence)))
    return SurfaceLabels(garment, confidence)


def most_mixed(distance: FloatArray, sigma: float, thickness: float) -> float:
    """Return the largest share of cloth among what lies just inside of the mannequin.

    The bare mannequin is scanned inside as often as outside, and cloth more often outside. Cloth just outside is what
    lies there more. Noise brings the larger share of it inside the nearer it is: all may lie at its least distance, or
    as close as it is spread evenly from zero on. Cloth that is pressed on lies as often inside.

    Args:
        distance: Signed, of what faces as the mannequin does [m], shape (V,).
        sigma: Noise of the scan [m].
        thickness: Of cloth [m].
    """
    width = SURELY_BARE
    inside = int(np.count_nonzero((distance < 0.0) & (distance > -width * sigma)))
    outside = int(np.count_nonzero((distance >= 0.0) & (distance < width * sigma)))
    below, beyond = ndtr(np.array([-width, width]) - thickness / sigma)
    here = ndtr(-thickness / sigma)
    at_once = (here - below) / max(beyond - here, 1e-12)
    tail = width * ndtr(-width) + (1.0 - np.exp(-0.5 * width**2)) / np.sqrt(2.0 * np.pi)  # of Φ, from -width to 0
    ratio = max(at_once, tail / (width - tail))
    if ratio >= 1.0 or inside == 0:
        return 1.0
    return float(np.clip(ratio / (1.0 - ratio) * (outside - inside) / inside, PRESSED, 1.0))


def extract_garment(surface: TriangleMesh, labels: SurfaceLabels, config: SubtractConfig, job: Job) -> TriangleMesh:
    """Return the garment as an open shell: cut smoothly along the label boundary, repaired, small pieces dropped.

    So are those that lie level, as cloth does not that is worn. Which of the others are worn, their openings tell.

    Raises:
        GarmentError: no piece is left.
    """
    side = smooth_values(surface, np.where(labels.garment, 1.0, -1.0), rounds=10)
    shell = clip_to_positive(surface, side)
    shell = repair(shell, RepairConfig(weld_mm=0.001), job)
    piece, area = component_areas(shell)
    if area.max() < config.smallest_piece_cm2 * 1e-4:
        raise GarmentError(f"the largest piece of garment has only {area.max() * 1e4:.1f} cm²")
    keep = area >= config.smallest_piece_cm2 * 1e-4
    small = ~keep
    for k in np.flatnonzero(keep & (area < area.max())):
        keep[k] = not is_level(submesh(shell, piece == k)[0], job)
    if small.any():
        job.note(f"dropped {int(small.sum())} small pieces of {1e4 * float(area[small].sum()):.1f} cm² in all")
    job.measure(area_cm2=1e4 * float(area[keep].sum()), pieces=int(keep.sum()), dropped_pieces=int((~keep).sum()))
    return submesh(shell, keep[piece])[0]


def _distance_evidence(
    distance: FloatArray, sigma: float, outward: float, thickness: float, thickened: FloatArray | None
) -> FloatArray:
    """Return the log-likelihood ratio of cloth, anywhere beyond its thickness, against bare mannequin at zero, (V,).

    Args:
        distance: Signed, to the mannequin [m], shape (V,).
        sigma, outward: Noise of the bare scan into the mannequin and out of it [m].
        thickness: Of cloth [m].
        thickened: Share of the bare mannequin there whose errors have the deviation `THICKER`, shape (V,), or None.
    """
    noise = np.where(distance > 0.0, outward, sigma)
    bare = -0.5 * np.square(distance / noise)
    if thickened is not None:
        wide = np.log(thickened * noise / THICKER) - 0.5 * np.square(distance / THICKER)
        bare = np.logaddexp(bare, wide)
    cloth = -0.5 * np.square(np.minimum((distance - thickness) / sigma, 0.0))
    return np.clip(cloth - bare - np.log(2.0 * TIGHT / (sigma + outward)), -CERTAIN, 2.0 * CERTAIN)


def boundary_price(surface: TriangleMesh, config: SubtractConfig) -> FloatArray:
    """Return the price of cutting each edge, shape (E,): by length, and less where the colour changes."""
    pair: IntArray = edges(surface)
    length = np.linalg.norm(surface.vertices[pair[:, 0]] - surface.vertices[pair[:, 1]], axis=1)
    price = config.smoothness * length / length.mean()
    if surface.colors is not None:
        lab = cielab(surface.colors)
        price = price * np.exp(-np.linalg.norm(lab[pair[:, 0]] - lab[pair[:, 1]], axis=1) / config.color_step)
    return price
