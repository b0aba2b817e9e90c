"""What a file or folder holds that may be given: counts, and lengths in metres."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.model.job import Job

_OPENINGS = 8
"""Of so many openings the lengths are listed: a garment has a handful, a scan's holes are hundreds."""


def _surface(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.avatar.standing import warn_of_misread_unit
    from vto_pipeline.geometry.remeshing.rims import perimeter
    from vto_pipeline.geometry.topology import boundary_loops
    from vto_pipeline.io.meshes import read_mesh
    from vto_pipeline.report.facts import surface_facts

    mesh = read_mesh(path, job=job)
    if mesh.metric:
        warn_of_misread_unit(mesh, job)
    facts = surface_facts(mesh)
    if facts["closed"]:
        return facts
    try:
        girths = sorted((perimeter(mesh, loop) for loop in boundary_loops(mesh)), reverse=True)
    except InputError as e:  # edges of three faces: what the openings are is not told by such a mesh
        job.note(f"{path.name}: openings not counted: {e.problem}")
        return facts
    return {**facts, "openings": len(girths), "longest_openings_m": girths[:_OPENINGS]}


def _cloud(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.avatar.standing import warn_of_misread_unit
    from vto_pipeline.io.clouds import read_cloud

    cloud = read_cloud(path, job=job)
    warn_of_misread_unit(cloud, job)
    return {
        "points": len(cloud.points),
        "size_m": [float(side) for side in cloud.points.max(axis=0) - cloud.points.min(axis=0)],
        "normals": cloud.normals is not None,
        "colours": cloud.colors is not None,
    }


def _photos(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.io.captures.photos import read_photos

    photos = read_photos(path, job=job)
    return {
        "photos": len(photos.paths),
        "with_a_focal_length": sum(one is not None for one in photos.intrinsics),
        "board": photos.board is not None,
    }


def _depth(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.io.captures.depth import read_depth_frames

    frames = read_depth_frames(path, job=job)
    return {
        "frames": len(frames.depth_paths),
        "pixels": [frames.intrinsics.width, frames.intrinsics.height],
        "colours": bool(frames.color_paths),
        "poses": frames.world_from_cam is not None,
    }


def _avatar(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.avatar.measure import measure
    from vto_pipeline.io.bodies.avatars import receive_avatar

    avatar = receive_avatar(path)
    measured = measure(avatar).values
    return {"vertices": len(avatar.vertices), **_in_si(measured)}


def _measurements(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.io.bodies.measurements import read_measurements

    read = read_measurements(path)
    return {"sex": read.sex, **_in_si(read.values)}


def _in_si(values: Mapping[str, float]) -> dict[str, float]:
    return {f"{key}_kg" if key == "mass" else f"{key}_m": value for key, value in values.items()}


def _fabric(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.io.fabrics import read_fabric

    fabric = read_fabric(path)
    figures = ("areal_density", "thickness", "stretch_warp", "stretch_weft", "shear", "bending_warp", "bending_weft")
    units = ("kg_per_m2", "m", *3 * ("n_per_m",), *2 * ("n_m",))
    return {
        "name": fabric.name,
        **{f"{figure}_{unit}": getattr(fabric, figure) for figure, unit in zip(figures, units, strict=True)},
        "friction": fabric.friction,
        "assumed": ", ".join(fabric.assumed),
    }


def _silhouettes(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.io.bodies.measurements import read_silhouettes

    return {"stature_m": read_silhouettes(path).stature}


def _video(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.io.captures.video import read_video

    video = read_video(path, job=job)
    return {"pixels": [video.width, video.height], "board": video.board is not None}


def _pattern(path: Path, job: Job) -> dict[str, Any]:
    from vto_pipeline.cli.commands.pattern.flat_lines import flat_facts
    from vto_pipeline.cli.commands.pattern.lines import pattern_facts
    from vto_pipeline.io.patterns.read import read_pattern

    pattern = read_pattern(path, job=job)
    facts, flat = pattern_facts(pattern), flat_facts(pattern, None)
    first: dict[str, Any] = next(iter(flat.get("sizes", {}).values()), {})  # vto pattern has all sizes
    return {
        "panels": len(facts["panels"]),
        "seams": len(facts["seams"]),
        "sizes": ", ".join(facts["sizes"]),
        "unit": facts["unit"],
        "cloth_m2": 1e-4 * sum(panel["area_cm2"] for panel in facts["panels"]),
        **{f"flat_{name}_m": 1e-3 * one["mm"] for name, one in first.items()},
    }


DESCRIPTIONS: dict[str, Callable[[Path, Job], dict[str, Any]]] = {
    "surface": _surface,
    "cloud": _cloud,
    "photos": _photos,
    "depth": _depth,
    "avatar": _avatar,
    "measurements": _measurements,
    "fabric": _fabric,
    "silhouettes": _silhouettes,
    "video": _video,
    "pattern": _pattern,
}
"""Kind of what may be given, as `find_kind` has it -> a function that reads it and returns what it holds."""
