"""The page: everything about a run in one self-contained file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vto_pipeline.model.cloth import TraceRow, seconds_within
from vto_pipeline.report.budgets import budget_lines
from vto_pipeline.report.chart import log_chart
from vto_pipeline.report.document import document
from vto_pipeline.report.layers import list_layers
from vto_pipeline.report.scene import build_page_scene, script_json
from vto_pipeline.report.tables import left_out_table, measurement_table
from vto_pipeline.report.verdicts import collect_verdicts, fit_reports

_GOOD_MM = (5.0, 1.0)  # distances to the final shape for which the page says when they were reached


def build_page(run_record: Mapping[str, Any], parts: Mapping[str, Any]) -> str:
    """Return the report of a run as one HTML document without references to anything outside.

    Args:
        run_record: What run.json holds.
        parts: Artifact -> value, as far as there are any: meshes and avatar for the 3D view with "fit_maps" and
            "labels" for its colours and "crossings" where cloth crosses something, "fit_report" or, of several
            garments, "fit_reports" by name, "measurements", "openings", "audit", "trace", and "motion", of garment and
            body. Others are ignored.
    """
    layers = list_layers(parts)
    trace = parts.get("trace", [])
    frame_time = parts["motion"][0].frame_time if "motion" in parts else None
    return document(
        "page.html",
        title=_title(parts),
        scene=script_json(build_page_scene(layers, frame_time)) if layers else "",
        moves=frame_time is not None,
        verdicts=collect_verdicts(run_record, parts),
        fits=fit_reports(parts),
        measurements=measurement_table(parts.get("measurements"), parts.get("body_measurements")),
        openings=parts.get("openings", []),
        audit=parts.get("audit", {}),
        chart=log_chart([row.seconds for row in trace], _distances(trace), "run time [s]", "distance [mm]"),
        trace_end=trace[-1] if trace else None,
        good_enough=[(distance, seconds_within(trace, distance)) for distance in _GOOD_MM],
        budgets=list(budget_lines(run_record, trace)),
        run=run_record,
        stages=[stage for stage in run_record.get("stages", []) if stage["status"] not in ("left_out", "planned")],
        left_out=left_out_table(run_record),
    )


def _distances(trace: Sequence[TraceRow]) -> dict[str, list[float | None]]:
    """Return what is drawn against run time: what was predicted, and what turned out."""
    return {
        "predicted while it ran": [row.error_mm for row in trace],
        "true, 95 % of the cloth": [row.true_mm_p95 for row in trace],
        "true, half of the cloth": [row.true_mm_median for row in trace],
    }


def _title(parts: Mapping[str, Any]) -> str:
    if "draped" in parts or "render_mesh" in parts:
        return "Garment on a body"
    if "garment" in parts or "garment_surface" in parts:
        return "Scanned garment"
    return "Body" if "avatar" in parts or "body_surface" in parts else "Run"
