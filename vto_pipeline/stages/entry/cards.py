"""What a notebook shows of meshes, garments, avatars and runs: a picture, counts, errors and seconds."""

from __future__ import annotations

from collections.abc import Sequence

from vto_pipeline.errors import VtoError
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages.entry.outcome import Outcome

_SIZE = (180, 240)  # px
_COVERED = 1.96  # standard deviations on either side that hold 95 % of a normal distribution
_GIRTHS = ("stature", "bust_girth", "waist_girth", "hip_girth")


def mesh_card(mesh: TriangleMesh) -> str:
    """Return HTML for a mesh: how it looks from the front, counts, size and area."""
    from vto_pipeline.report.card import card

    return card("Mesh", _picture([mesh]), _surface(mesh))


def garment_card(garment: Garment) -> str:
    """Return HTML for a garment ready to simulate."""
    from vto_pipeline.report.card import card

    rest = garment.rest
    kind = rest.mode.replace("_", " ") + (", made anew in proportion to another body" if rest.regraded else "")
    return card("Garment", _picture([garment.mesh]), {**_surface(garment.mesh), "rest shape": kind})


def avatar_card(avatar: Avatar) -> str:
    """Return HTML for an avatar: how it stands, and its stature and girths with their uncertainty."""
    from vto_pipeline.avatar.measure import measure
    from vto_pipeline.report.card import card
    from vto_pipeline.report.wording import centimetres, label

    facts = {"vertices": f"{len(avatar.vertices):,}", "joints": str(len(avatar.joint_names))}
    values = measure(avatar).values
    for name in _GIRTHS:
        if name in values:
            sigma = avatar.sigmas.get(name)
            spread = "" if sigma is None else f" ± {centimetres(_COVERED * sigma)} (95 %)"
            facts[label(name)] = f"{centimetres(values[name])} cm{spread}"
    return card("Avatar", _picture([avatar.mesh]), facts, avatar.caveats)


def outcome_card(outcome: Outcome) -> str:
    """Return HTML for a run: what it made, how well, its warnings, and the seconds of each stage."""
    from vto_pipeline.report.card import card
    from vto_pipeline.report.wording import duration, label

    facts = {"folder": str(outcome.folder), "time": duration(outcome.seconds)}
    picture, notes = None, [f"{label(name)}: {text}" for name, text in outcome.warnings]
    try:
        notes = [*outcome.verdicts, *notes]
        meshes = _shown(outcome)
        picture = _picture(meshes)
        facts |= {"drawn": f"{sum(len(mesh.faces) for mesh in meshes):,} triangles"} if meshes else {}
        facts |= _errors(outcome)
    except VtoError as error:  # its files may be gone or another run's, and what its record says still counts
        notes.append(f"not all of it can be read: {error.problem}")
    rows = [("stage", "ended", "time")]
    for stage in outcome.record["stages"]:
        if stage["status"] not in ("left_out", "planned"):
            spent = stage.get("seconds")
            rows.append((label(stage["name"]), stage["status"], "" if spent is None else duration(spent)))
    return card("Run", picture, facts, notes, rows)


def _surface(mesh: TriangleMesh) -> dict[str, str]:
    from vto_pipeline.report.facts import surface_facts

    found = surface_facts(mesh)
    scale, unit = (100.0, "cm") if mesh.metric else (1.0, "of an unknown unit")
    sides = " x ".join(f"{scale * side:.1f}" if mesh.metric else f"{side:.3g}" for side in found["size_m"])
    facts = {
        "vertices": f"{found['vertices']:,}",
        "triangles": f"{found['triangles']:,}",
        "size": f"{sides} {unit}",
        "pieces": f"{found['pieces']}, {'closed' if found['closed'] else 'open'}",
    }
    if mesh.metric:
        facts["area"] = f"{found['area_m2']:.3f} m²"
    if found["edges_of_more_than_two_faces"]:
        facts["edges of more than two faces"] = f"{found['edges_of_more_than_two_faces']:,}"
    if mesh.skin is not None:
        height, width = mesh.skin.picture.shape[:2]
        facts["picture"] = f"{width} x {height} px"
    return facts


def _errors(outcome: Outcome) -> dict[str, str]:
    """Return how far from rest a drape may be, and what its judge counted."""
    from vto_pipeline.report.wording import figure

    facts = {}
    if outcome.made("trace") and (trace := outcome.read("trace")):
        facts["distance to rest"] = f"{figure('error_mm', trace[-1].error_mm)}, predicted"
    if outcome.made("audit"):
        audit = outcome.read("audit")
        facts |= {
            f"crossings, {kind}": str(audit[f"{kind}_intersections"])
            for kind in ("body", "self")
            if f"{kind}_intersections" in audit
        }
    return facts


def _shown(outcome: Outcome) -> list[TriangleMesh]:
    from vto_pipeline.stages.entry.shown import shown_artifacts, shown_meshes

    return [mesh for name in shown_artifacts(outcome) for mesh in shown_meshes(name, outcome.read(name))]


def _picture(meshes: Sequence[TriangleMesh]) -> ByteArray | None:
    """Return meshes from the front; None where that shows nothing."""
    import numpy as np

    from vto_pipeline.render.frames import bounds
    from vto_pipeline.render.pictures import render_picture

    if not meshes:
        return None
    low, high = bounds(meshes)
    return render_picture(meshes, size=_SIZE) if np.all(high[:2] > low[:2]) else None
