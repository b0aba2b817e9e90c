"""The fit report: whether the garment fits the body, and where it does not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.assess.allowance import Allowance, read_allowances
from vto_pipeline.assess.clearance import clearance, summarise_clearance
from vto_pipeline.assess.ease import Ease
from vto_pipeline.assess.ease_map import ease_map
from vto_pipeline.assess.strain import principal_stretches, summarise_stretch
from vto_pipeline.assess.surface import face_areas, to_vertices, vertex_areas
from vto_pipeline.assess.zones import ease_at_levels, ease_at_openings
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config


class FitConfig(Config):
    """Settings of the fit report."""

    garment: str = Field("shirt", description="Kind of garment, a row of assess/allowances.yaml")
    allowances_cm: dict[str, tuple[float, float]] = Field(
        default_factory=dict, description="Zone -> lowest and highest wearing ease [cm], in place of the table's"
    )
    stretch_limit: float = Field(
        0.05, gt=0, le=1, description="Stretch beyond rest above which cloth counts as over-stretched [share]"
    )
    contact_mm: float = Field(3.0, gt=0, le=50, description="Distance below which cloth counts as touching [mm]")


def assess_fit(
    draped: TriangleMesh,
    rest: FloatArray,
    body: TriangleMesh,
    levels: Mapping[str, float],
    fabric: Fabric,
    config: FitConfig,
    job: Job,
    *,
    trunk: NDArray[np.bool_] | None = None,
    observed_share: float | None = None,
    mode: str = "same_garment",
) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Judge a draped garment on a body.

    Args:
        draped: Simulation mesh at rest on the body [m].
        rest: Its rest positions [m], shape (V, 3).
        body: The body it hangs on [m].
        levels: Zone -> height [m] at which to measure, such as {"chest": 1.25, "waist": 1.05, "hip": 0.9}.
        fabric: What it is made of.
        config: Settings.
        job: Takes warnings, figures and levels left out.
        trunk: Which body vertices are neither arm nor leg, shape (B,). Without it an arm that touches the trunk is
            measured with it.
        observed_share: Share of the garment's area that a sensor saw, when it was scanned.
        mode: "same_garment", or "regraded" when the rest shape was made in proportion to this body.

    Returns:
        The report (plain JSON values), and per vertex of `draped` the maps "stretch" (largest principal stretch, 1 at
        rest), "clearance_mm" (to the body, negative inside) and "ease_mm" (at that height; NaN off the trunk), each of
        shape (V,).

    Raises:
        ConfigError: an unknown kind of garment.
    """
    allowances = read_allowances(config.garment) | {
        zone: Allowance(low / 100, high / 100, "settings") for zone, (low, high) in config.allowances_cm.items()
    }
    job.progress(0.0, "distance to the body")
    nearest = clearance(draped, body)
    body_faces = np.ones(len(body.faces), dtype=bool) if trunk is None else np.all(trunk[body.faces], axis=1)
    garment_faces = np.all(body_faces[nearest.face][draped.faces], axis=1)

    job.progress(0.6, "ease")
    at_levels = ease_at_levels(draped, rest, body, levels, garment_faces, body_faces)
    for zone in (zone for zone, ease in at_levels.items() if ease is None):
        job.leave_out(f"ease at the {zone}", "the garment does not go around the body there")
    measured = {zone: ease for zone, ease in at_levels.items() if ease is not None}
    measured |= ease_at_openings(draped, rest, body)
    zones = [_zone(name, ease, allowances.get(name)) for name, ease in measured.items()]

    job.progress(0.8, "stretch")
    areas = face_areas(rest, draped.faces)
    largest = principal_stretches(draped.vertices, rest, draped.faces)[:, 0]
    stretch = summarise_stretch(largest, areas, config.stretch_limit)
    around = vertex_areas(face_areas(draped.vertices, draped.faces), draped.faces, len(draped.vertices))
    gap = summarise_clearance(nearest.distance, around, config.contact_mm / 1000)

    report = {
        "schema": 1,
        "mode": mode,
        "garment": config.garment,
        "fabric": fabric.name,
        "fabric_assumed": list(fabric.assumed),
        "verdict": _verdict(zones, stretch, gap),
        "zones": zones,
        "strain": stretch,
        "clearance": gap,
        "observed_share": observed_share,
        "note": _unobserved_note(observed_share),
    }
    maps = {
        "stretch": to_vertices(largest, areas, draped.faces, len(draped.vertices)),
        "clearance_mm": 1000 * nearest.distance,
        "ease_mm": 1000 * ease_map(draped, rest, body, garment_faces, body_faces),
    }
    _tell(report, job)
    return report, maps


def _zone(name: str, measured: Ease, allowance: Allowance | None) -> dict[str, Any]:
    return {
        "zone": name,
        "body_girth_m": measured.body_girth,
        "garment_girth_m": measured.garment_girth,
        "cloth_length_m": measured.cloth_length,
        "rest_length_m": measured.rest_length,
        "stretch": measured.stretch,
        "ease_m": measured.ease,
        "allowance_m": None if allowance is None else [allowance.low, allowance.high],
        "source": "" if allowance is None else allowance.source,
        "closed": measured.closed,
        "verdict": _judge(measured, allowance),
    }


def _judge(measured: Ease, allowance: Allowance | None) -> str:
    if measured.pulled:
        return "stretched"  # no way around this body without pulling the cloth
    if allowance is None:
        return "no allowance known"
    if measured.ease < allowance.low:
        return "tight"
    return "loose" if allowance.high is not None and measured.ease > allowance.high else "good"


def _verdict(zones: list[dict[str, Any]], stretch: Mapping[str, float], gap: Mapping[str, float]) -> str:
    """Summarise the fit in one sentence."""
    parts = [
        f"{z['zone']} {z['verdict']} ({100 * z['ease_m']:+.1f} cm)"
        for z in zones
        if z["verdict"] != "no allowance known"
    ]
    sentence = "; ".join(parts) if parts else "no zone with a known allowance"
    if stretch["share_over_limit"] > 0.01:
        sentence += f"; {stretch['share_over_limit']:.0%} of the cloth is stretched beyond {stretch['limit']:.0%}"
    if gap["inside_vertices"]:
        sentence += f"; {gap['inside_vertices']} vertices inside the body, deepest {-gap['min_mm']:.1f} mm"
    return sentence[0].upper() + sentence[1:] + "."


def _unobserved_note(observed_share: float | None) -> str:
    if observed_share is None or observed_share > 0.995:
        return ""
    share = 1 - observed_share
    return f"{share:.0%} of the garment was not seen by the scanner and was filled in; figures there are guesses."


def _tell(report: Mapping[str, Any], job: Job) -> None:
    job.measure(
        contact_share=report["clearance"]["contact_share"],
        stretch_p95_share=report["strain"]["p95"],
        **{f"ease_{z['zone'].replace(' ', '_')}_mm": 1000 * z["ease_m"] for z in report["zones"]},
    )
    for zone in report["zones"]:
        if zone["verdict"] in ("stretched", "tight"):
            job.warn(f"{zone['zone']}: {zone['verdict']}, {100 * zone['ease_m']:+.1f} cm of ease")
    if report["clearance"]["inside_vertices"]:
        job.warn(f"{report['clearance']['inside_vertices']} garment vertices lie inside the body")
    if report["note"]:
        job.warn(report["note"])
