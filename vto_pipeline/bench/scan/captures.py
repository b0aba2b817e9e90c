"""Capture folders with a known garment, each scanned as a user would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.own_process import run_vto
from vto_pipeline.bench.scan.blame import blame, cameras_beside_form
from vto_pipeline.bench.scan.shown_rims import shown_rims
from vto_pipeline.bench.scan.truth import beside_truth, cameras_off
from vto_pipeline.io.captures.cameras import read_cameras
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_mesh, read_own_mesh

FORM, TRUTH = "body.ply", "truth/garment.ply"
"""What a capture folder holds besides the kinds: the bare form, and the garment that was photographed on it."""

CAMERAS = "truth/cameras.json"
"""And it may hold this: {"cameras": [{"name", "R", "t"}]}, camera from world, in metres."""

KINDS = ("photos", "depth", "cloud.ply")
"""What a capture folder may hold to scan from."""


def scan_row(capture: Path, kind: str, folder: Path, settings: Sequence[str], limit: float) -> dict[str, Value]:
    """Return what became of one scan; figures that it did not reach are None.

    Args:
        capture: Folder with the kind, `FORM` and `TRUTH`.
        kind: One of `KINDS`.
        folder: Of the run.
        settings: As `--set` takes them.
        limit: Wall time after which the run is ended [s].
    """
    command = ["scan", str(capture / kind), "--role", "garment", "--mannequin", str(capture / FORM), "-o", str(folder)]
    for one in settings:
        command += ["--set", one]
    ended = run_vto(command, folder.parent / f"{folder.name}.log", limit)
    garment = folder / "out" / "garment.ply"
    found: dict[str, Value] = {}
    if ended.code == 0 and garment.is_file():
        scanned, truth, form = read_own_mesh(garment), read_mesh(capture / TRUTH), read_mesh(capture / FORM)
        found = beside_truth(scanned, truth) | blame(folder, truth, form)
        cameras = cameras_beside_form(folder)
        if cameras is not None:
            found |= shown_rims(scanned, truth, form, cameras)
    return {
        "capture": capture.name,
        "kind": kind,
        "exit": ended.code,
        "seconds": ended.seconds,
        "cpu_s": ended.cpu_seconds,
        "peak_mb": ended.peak_mb,
        "cameras_mm": _cameras_mm(capture / CAMERAS, folder / "out" / "cameras.json"),
        **found,
        **_own_figures(folder),
        "reason": _reason(folder),
    }


def _own_figures(folder: Path) -> dict[str, Value]:
    """Return what the scan says of itself, as far as it has got."""
    report = _document(folder / "out" / "scan_report.json")
    error = report.get("predicted_error_mm") or {}
    scale = report.get("scale") or {}
    return {
        "metric": report.get("metric"),
        "scale_source": scale.get("source"),
        "said_scale_percent": scale.get("error_percent"),
        "predicted_median_mm": error.get("median"),
        "predicted_p95_mm": error.get("p95"),
    }


def _cameras_mm(truth: Path, found: Path) -> float | None:
    """Return how far the photos' cameras are off [mm], where both are known."""
    if not truth.is_file() or not found.is_file():
        return None
    records = read_json(truth)["cameras"]
    places = {one["name"]: -np.array(one["R"]).T @ np.array(one["t"]) for one in records}
    return cameras_off(read_cameras(found), places)


def _reason(folder: Path) -> str | None:
    """Return why the run failed, as run.json has it."""
    failed = [s for s in _document(folder / "run.json").get("stages", []) if s["status"] == "failed"]
    return f"{failed[0]['name']}: {failed[0]['reason']}" if failed else None


def _document(path: Path) -> Mapping[str, Any]:
    return read_json(path) if path.exists() else {}
