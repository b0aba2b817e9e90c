"""What a scan says of itself, gathered from its stages: scale and its source, coverage, error, what was left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.standing import warn_of_misread_unit
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.scan.depth_views import DepthViews, depth_only, frame_views
from vto_pipeline.scan.disagreement import predicted_error
from vto_pipeline.stages.roles import ROLES

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]

_OF_A_GARMENT = ("align", "subtract", "openings")
"""Stages of a scanned garment whose name has no role."""
_NORMAL = {"median": 0.6745, "p95": 1.96}
"""Quantiles of the distance from a normal distribution's middle, in standard deviations."""
_SOURCES = {"odometry": "depth camera", "poisson": "the file's unit"}
"""Stage -> where the scale of its surface comes from, when it does not say."""


def scan_report(
    role: str,
    surface_is_metric: bool,
    run_record: Mapping[str, Any],
    error_of: Callable[[float, float], Mapping[str, float | None] | None] | None = None,
    lever: float = 0.0,
) -> dict[str, Any]:
    """Return what scan_report.json holds.

    Args:
        role: Of the scan.
        surface_is_metric: Whether the surface as scanned is in metres.
        run_record: What run.json holds; of its stages, those that ran for this role.
        error_of: Predicts the error [mm] from the metres in a unit of the surface and the share that was filled.
        lever: Typical distance of the surface from its middle, in its unit: what an error of the scale acts on.
    """
    said: dict[str, Any] = {}
    source = None if not surface_is_metric else "the file's unit"
    for stage in run_record["stages"]:
        owner, _, name = stage["name"].rpartition(".")
        mine = owner == role or (role == "garment" and not owner and name in _OF_A_GARMENT)
        if mine and stage["status"] in ("ran", "cached"):
            said |= stage["metrics"]
            source = _SOURCES.get(name, source)
    source = said.get("scale_source", source)
    unit = said.get("metres_per_unit", 1.0 if surface_is_metric else None)
    error = None
    if error_of is not None and unit is not None:
        error = error_of(unit, said.get("filled_share") or 0.0)
    if error is not None and unit is not None:
        error = _with_scale(error, 10.0 * (said.get("scale_error_percent") or 0.0) * lever * unit)
    return {
        "role": role,
        "metric": source is not None,
        "scale": {
            "source": source,
            "metres_per_unit_of_surface": unit,
            "error_percent": said.get("scale_error_percent"),
        },
        "predicted_error_mm": error,
        "coverage": said.get("coverage"),
        "unobserved_share": said.get("unobserved_share"),
        "openings": said.get("openings"),
        "pieces": said.get("pieces"),
        "used": said.get("registered"),
        "given": said.get("photos"),
        "left_out": said.get("left_out_photos", {}),
    }


def _with_scale(error: Mapping[str, float | None], sigma: float) -> dict[str, float | None]:
    """Return quantiles of the error [mm] with what the scale adds, a normal distribution's of that deviation [mm]."""
    whole: dict[str, float | None] = {}
    for name, seen in error.items():
        whole[name] = None if seen is None else round(float(np.hypot(seen, _NORMAL[name] * sigma)), 3)
    return whole


def _stage(role: str) -> Stage:
    def run(inputs: Inputs, settings: Config, job: Job) -> Outputs:
        surface, record = inputs[f"{role}_surface"], inputs["run_record"]
        views = _views(inputs, role)
        if role == "body" and surface.metric:
            warn_of_misread_unit(surface, job)
        if views is None:
            return {f"{role}_scan_report": scan_report(role, surface.metric, record)}
        if role == "garment" and "garment" in inputs:
            surface = _seen_of(inputs["garment"], inputs["observed"], inputs.get("garment_placement"))
        lever = float(np.median(np.linalg.norm(surface.vertices - surface.vertices.mean(axis=0), axis=1)))

        def error_of(unit: float, filled: float) -> Mapping[str, float | None] | None:
            return predicted_error(views, surface, unit, filled)

        return {f"{role}_scan_report": scan_report(role, surface.metric, record, error_of, lever)}

    return Stage(
        name=f"{role}.scan_report",
        about="how good the scan is, as far as it can tell itself",
        needs=(f"{role}_surface",),
        optional=(
            *(f"{role}_{name}" for name in ("depth_maps", "depth", "trajectory")),
            *(("garment", "observed", "garment_placement") if role == "garment" else ()),
        ),
        makes=(f"{role}_scan_report",),
        run=run,
        final=True,
    )


def _seen_of(garment: TriangleMesh, observed: NDArray[np.bool_], garment_from_scan: FloatArray | None) -> TriangleMesh:
    """Return what was seen (V,) of a finished garment, in the frame of the scan."""
    seen, _ = submesh(garment, np.all(observed[garment.faces], axis=1))
    return seen if garment_from_scan is None else transform_mesh(seen, np.asarray(np.linalg.inv(garment_from_scan)))


def _views(inputs: Inputs, role: str) -> DepthViews | None:
    """Return the depth maps that the surface was made from; None where it was made from none."""
    if f"{role}_depth_maps" in inputs:
        return depth_only(inputs[f"{role}_depth_maps"])
    if f"{role}_depth" in inputs and f"{role}_trajectory" in inputs:
        return frame_views(inputs[f"{role}_depth"], inputs[f"{role}_trajectory"])
    return None


STAGES: tuple[Stage, ...] = tuple(_stage(role) for role in ROLES)
