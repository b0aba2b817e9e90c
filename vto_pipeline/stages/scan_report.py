"""What a scan says of itself, gathered from its stages: scale and its source, coverage, error, what was left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.stages.roles import ROLES

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]

_OF_A_GARMENT = ("align", "subtract", "openings")
"""Stages of a scanned garment whose name has no role."""
_SOURCES = {"odometry": "depth camera", "poisson": "the file's unit"}
"""Stage -> where the scale of its surface comes from, when it does not say."""


def scan_report(role: str, surface_is_metric: bool, run_record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what scan_report.json holds.

    Args:
        role: Of the scan.
        surface_is_metric: Whether the surface as scanned is in metres.
        run_record: What run.json holds; of its stages, those that ran for this role.
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
    return {
        "role": role,
        "metric": source is not None,
        "scale": {
            "source": source,
            "metres_per_unit_of_surface": said.get("metres_per_unit", 1.0 if surface_is_metric else None),
            "error_percent": said.get("scale_error_percent"),
        },
        "predicted_error_mm": said.get("predicted_error_mm"),
        "coverage": said.get("coverage"),
        "unobserved_share": said.get("unobserved_share"),
        "openings": said.get("openings"),
        "used": said.get("registered"),
        "given": said.get("photos"),
        "left_out": said.get("left_out_photos", {}),
    }


def _stage(role: str) -> Stage:
    def run(inputs: Inputs, settings: Config, job: Job) -> Outputs:
        surface = inputs[f"{role}_surface"]
        return {f"{role}_scan_report": scan_report(role, surface.metric, inputs["run_record"])}

    return Stage(
        name=f"{role}.scan_report",
        about="how good the scan is, as far as it can tell itself",
        needs=(f"{role}_surface",),
        makes=(f"{role}_scan_report",),
        run=run,
        final=True,
    )


STAGES: tuple[Stage, ...] = tuple(_stage(role) for role in ROLES)
