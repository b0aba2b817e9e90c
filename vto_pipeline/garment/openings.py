"""Tell openings of the garment from holes in the scan; fill the holes, clean the rims of the openings."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.align import PosedPhotos
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.lifting import HINT, check_lifted, lift_fillings, pierced_fillings
from vto_pipeline.garment.loop_evidence import encloses, measure_loops
from vto_pipeline.garment.notches import close_notches
from vto_pipeline.garment.photographed.bridged import bridge_straps
from vto_pipeline.garment.photographed.carved import carve_fillings
from vto_pipeline.garment.photographed.confirmed import LookAgain, confirm_fillings
from vto_pipeline.garment.photographed.parted import refuse_parted, refuse_unseen
from vto_pipeline.garment.photographed.seen_ends import Scanned, Seen, refuse_unseen_ends
from vto_pipeline.garment.photographed.sightings import look_at_mannequin
from vto_pipeline.garment.pierced import open_pierced
from vto_pipeline.garment.rims import drop_flaps, fair_rims, trim_ledges
from vto_pipeline.garment.subtraction.pieces import (
    lost_cloth,
    may_be_worn,
    split_off,
    warn_of_torn,
    without_crumbs,
)
from vto_pipeline.garment.told_apart import Evidence, Judged, listing, tell_apart, worn_faces
from vto_pipeline.garment.wearable import LEAST_PERIMETER_MM, check_wearable, warn_one_sided
from vto_pipeline.geometry.remeshing.decimate import decimate, faces_at
from vto_pipeline.geometry.remeshing.holes import fill_holes
from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.remeshing.repair import RepairConfig, repair
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_areas, face_components, surface_area
from vto_pipeline.model.garment import Opening
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

FILLED_RIM = 1.0 / 3.0
"""With a larger share of its rim filled, an opening's length is uncertain."""


class OpeningsConfig(Config):
    """What counts as an opening, and how far its rim is cleaned."""

    edge_mm: float = Field(4.0, ge=0.5, le=50, description="Finer scans are thinned to about this edge length [mm]")
    expected: int | None = Field(
        None, ge=0, le=50, description="Number of openings of all pieces together; any other count is an error"
    )
    keep: int | None = Field(
        None,
        ge=1,
        le=50,
        description="Number of openings of all pieces together that stay, whatever the evidence: the likeliest, then "
        "longest",
    )
    least_seen: float = Field(
        0.8, ge=0, le=1, description="Share of the garment that must have been seen; `keep` makes less a warning"
    )
    ledge_mm: float = Field(40.0, ge=0, le=200, description="Widest ledge sought between cloth and mannequin [mm]")
    flap_edges: float = Field(4.0, ge=0, le=50, description="Parts that hang on by less are dropped [edge lengths]")
    fair_mm: float = Field(40.0, ge=0, le=200, description="Zigzags shorter than this are smoothed out of rims [mm]")
    reach_mm: float = Field(60.0, ge=0, le=300, description="How far inside an opening the mannequin may end [mm]")
    look_again: bool = Field(True, description="Look in the photos for what was filled; it moves to where they show it")
    clearance_mm: float = Field(1.0, ge=0, le=20, description="Least distance of fillings from the mannequin [mm]")
    least_perimeter_mm: float = Field(
        LEAST_PERIMETER_MM, ge=0, le=5000, description="Smaller loops are never openings [mm]"
    )
    tubular: float = Field(0.4, ge=0, le=1, description="Without a mannequin, how tube-like an opening must be")


def close_scan_holes(
    shell: TriangleMesh,
    mannequin: TriangleMesh | None,
    config: OpeningsConfig,
    job: Job,
    bare: BareParts | None = None,
    photos: PosedPhotos | None = None,
    look: LookAgain | None = None,
    scan: Scanned | None = None,
) -> tuple[TriangleMesh, list[Opening], NDArray[np.bool_]]:
    """Fill the scan holes and keep the garment's own openings.

    With a mannequin a loop is an opening when the body passes through it. Without one, or where the cloth hangs beyond
    it, when the loop is long and the cloth runs across its plane like the end of a tube; that is a guess, and said so.
    A filling that a part of the mannequin comes through is opened there once, with a warning.

    A garment may have several pieces, as a jacket and trousers. The largest is one. Another is if the mannequin passes
    through two openings of it, or one that goes round it. The others are left out; cloth among them counts as not seen.

    Args:
        shell: The garment cut out of the scan, oriented outward.
        mannequin: In the same frame, or None.
        config: Settings.
        job: Receives counts and perimeters.
        bare: What was seen of the bare mannequin, if it is known.
        photos: Of the garment on the mannequin, in its frame: what they show is held beside the result.
        look: Looks in the photos for what was filled; what they confirm counts as observed.
        scan: All that was scanned, in that frame, and its cameras, which tell what was seen beyond the rims.

    Returns:
        The garment; its openings, highest first; which of its vertices were observed, shape (V,).

    Raises:
        GarmentError: another number of openings than expected, a hole that cannot be filled, too little was seen,
            cloth was lost that makes several openings of one, or nothing was seen beyond a rim.
        InputError: no opening is left that a body could get through.
    """
    job.progress(0.0, "cleaning rims")
    distance = None if mannequin is None else SurfaceDistance(mannequin)
    large, rest = split_off(shell, may_be_worn(shell, distance))
    thinned = _thinned(large, config.edge_mm * 1e-3, job)
    trimmed = thinned if mannequin is None else trim_ledges(thinned, mannequin, config.ledge_mm * 1e-3)
    edge = float(np.median(edge_lengths(trimmed)))
    least_perimeter = config.least_perimeter_mm * 1e-3
    reach = config.reach_mm * 1e-3
    passed = None if distance is None else partial(encloses, distance=distance, reach=reach)
    whole = drop_flaps(trimmed, config.flap_edges * edge, least_perimeter, passed)
    clean = repair(whole, RepairConfig(weld_mm=0.0), job)
    bridged, notches, sightings = clean, 0, None
    if mannequin is not None and photos is not None:
        silent = Job(seed=job.seed)  # it is told once, of the finished garment
        sightings = look_at_mannequin(clean, np.ones(len(clean.vertices), dtype=bool), mannequin, photos, silent)
    evidence = Evidence(distance, bare, sightings, least_perimeter, reach, config.tubular, config.keep)
    if distance is not None:
        if sightings is not None and _asks_for_more(clean, evidence):
            bridged = bridge_straps(clean, sightings, distance, least_perimeter, config.clearance_mm * 1e-3, job)
        bridged, notches = close_notches(bridged, distance, evidence.over_bare, least_perimeter, reach)
    worn = worn_faces(bridged, evidence, job)
    bridged, _ = split_off(bridged, worn)
    clean, unworn = split_off(clean, worn[: len(clean.faces)])
    pieces = face_components(clean)[0]
    judged = tell_apart(bridged, evidence, job)
    job.progress(0.5, f"filling {len(judged.shapes) - sum(judged.is_opening)} scan holes")
    if all(judged.is_opening):
        job.leave_out("hole filling", "every boundary loop is a real opening")
    filled = _filled(bridged, judged)
    observed = np.arange(len(filled.vertices)) < len(clean.vertices)
    if mannequin is not None and distance is not None:
        lifted = lift_fillings(filled, ~observed, distance, config.clearance_mm * 1e-3)
        pierced = [] if config.keep is not None else pierced_fillings(lifted, distance, bare)
        if pierced:
            opened = open_pierced(filled, len(clean.faces), pierced, mannequin, bare, config.clearance_mm * 1e-3, job)
            judged = tell_apart(opened, evidence, job)
            filled = _filled(opened, judged)
            observed = np.zeros(len(filled.vertices), dtype=bool)
            observed[filled.faces[: len(clean.faces)]] = True
            lifted = lift_fillings(filled, ~observed, distance, config.clearance_mm * 1e-3)
            check_lifted(lifted, distance, bare)
            for one in pierced:
                job.warn(f"{one.reason}; it was opened there, and where its rim runs is uncertain. {HINT}")
        filled, observed = lifted.after, ~lifted.filled
        job.measure(lifted_cm2=1e4 * float(face_areas(filled)[lifted.moved[filled.faces].any(axis=1)].sum()))
    final = fair_rims(filled, config.fair_mm * 1e-3)
    if face_components(final)[0] != pieces:
        raise GarmentError(f"the garment fell apart into {face_components(final)[0]} pieces")
    count = sum(judged.is_opening)
    if config.expected is not None and count != config.expected:
        raise GarmentError(f"{count} openings found, expected {config.expected}: {listing(judged)}")
    scanned = np.arange(len(final.faces)) < len(clean.faces)
    if mannequin is not None and distance is not None and photos is not None and count and not observed.all():
        final = carve_fillings(final, observed, mannequin, photos, distance, config.clearance_mm * 1e-3, job)
    if look is not None and not observed.all():
        job.progress(0.6, "looking again at what was filled")
        before = observed
        final, observed = confirm_fillings(final, before, look, distance, config.clearance_mm * 1e-3, job)
        scanned |= observed[final.faces].all(axis=1) & ~before[final.faces].all(axis=1)
    found = list_openings(final)
    check_wearable(final, found)
    lost = lost_cloth([*rest, *unworn], final, observed, distance, job)
    scanned_area, area = float(face_areas(final)[scanned].sum()), surface_area(final)
    seen = scanned_area / (area + lost)
    job.measure(
        pieces=pieces,
        openings=len(found),
        filled_holes=len(judged.shapes) - count,
        filled_notches=notches,
        perimeters_mm=[round(opening.perimeter * 1e3, 1) for opening in found],
        trimmed_cm2=(surface_area(large) - sum(map(surface_area, [clean, *unworn]))) * 1e4,
        unobserved_share=1.0 - seen,
        filled_share=1.0 - scanned_area / area,
    )
    _check_seen(seen, final, config, job)
    sightings, answered = None, config.keep is not None or config.expected is not None
    hardly_told = photos is not None and not photos.beside_depth  # unless by their colours
    if mannequin is not None and found:
        sightings = None if photos is None else look_at_mannequin(final, observed, mannequin, photos, job)
        if sightings is not None:
            refuse_parted(sightings, final, found, config.keep is not None, job)
        if bare is not None and not (hardly_told and sightings is None):
            refuse_unseen(final, found, mannequin, bare, sightings, answered, job)
    if scan is not None:
        seen_beyond = Seen(scan, distance, bare, sightings)
        refuse_unseen_ends(final, found, seen_beyond, answered or (hardly_told and sightings is None), job)
    warn_of_filled_rims(found, observed, job)
    for what in judged.unsure if not answered else []:
        job.warn(what)
    if pieces == 1 and not answered:
        warn_one_sided(found, job)
    if bare is not None and pieces > 1:
        warn_of_torn(final, bare, job)
    return final, found, observed


def _asks_for_more(mesh: TriangleMesh, evidence: Evidence) -> bool:
    """Return whether more openings may be made of those that a garment has: not where fewer or as many are to stay."""
    if evidence.keep is None:
        return True
    return sum(tell_apart(mesh, evidence._replace(keep=None), Job()).is_opening) < evidence.keep


def _filled(mesh: TriangleMesh, judged: Judged) -> TriangleMesh:
    """Return the mesh with the loops filled that are no openings."""
    return fill_holes(
        mesh, [shape.walk for shape, real in zip(judged.shapes, judged.is_opening, strict=True) if not real]
    )


def list_openings(garment: TriangleMesh) -> list[Opening]:
    """Return the boundary loops of a finished garment, highest first."""
    found = [Opening(s.loop, s.perimeter, s.center, s.normal) for s in measure_loops(garment)]
    return sorted(found, key=lambda opening: (-opening.center[1], opening.center[0]))


def warn_of_filled_rims(openings: list[Opening], observed: NDArray[np.bool_], job: Job) -> None:
    """Warn of openings whose rims were filled for the most part, with their places.

    Args:
        openings: Of the garment.
        observed: Which of its vertices were seen, shape (V,).
        job: Receives the warnings.
    """
    for opening in openings:
        filled = float(np.mean(~observed[opening.loop]))
        if filled >= FILLED_RIM:
            x, y, z = opening.center
            what = f"the opening of {opening.perimeter * 1e3:.0f} mm at ({x:.2f}, {y:.2f}, {z:.2f}) m is uncertain"
            job.warn(f"{what}: {100.0 * filled:.0f} % of its rim was not seen, and filled; take more photos of it")


def _thinned(shell: TriangleMesh, edge: float, job: Job) -> TriangleMesh:
    """Return the shell without triangles much smaller than wanted; what the thinning breaks is repaired."""
    faces = faces_at(shell, edge)
    if len(shell.faces) <= faces:
        job.leave_out("thinning", f"{len(shell.faces)} faces; the target is {faces}")
        return shell
    job.note(f"thinned {len(shell.faces)} faces to {faces}")
    return without_crumbs(repair(decimate(shell, faces, aggressiveness=3.0), RepairConfig(weld_mm=0.0), job))


def _check_seen(share: float, garment: TriangleMesh, config: OpeningsConfig, job: Job) -> None:
    """Refuse a garment of which too little was seen: fillings would decide its shape. Who says how many openings it has
    answers for it.

    Raises:
        GarmentError: less was seen than `least_seen`, and `keep` is not given.
    """
    if share >= config.least_seen:
        return
    problem = f"only {100.0 * share:.1f} % of the garment was seen; the rest was filled and may be off by centimetres"
    if config.keep is not None:
        job.warn(problem)
        return
    raise GarmentError(
        f"{problem} (the least is {100.0 * config.least_seen:.0f} %)",
        hint="take more photos or frames of what is missing, often under the arms and from above and below. "
        "Or look at it, and set openings.keep or a lower openings.least_seen",
        partial={"garment": garment},
    )
