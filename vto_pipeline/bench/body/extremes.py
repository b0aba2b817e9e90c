"""Extreme people and scans: each must give an answer with its uncertainty, a warning or a refusal."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.template.template import JOINT_KINDS, membership
from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.body.people import random_body
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.errors import AvatarError
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

_TAPES = {
    "child of 1.20 m": Measurements({"stature": 1.20, "mass": 25.0}, sex="neutral"),
    "2.10 m": Measurements({"stature": 2.10, "mass": 100.0}, sex="male"),
    "200 kg": Measurements({"stature": 1.80, "mass": 200.0}, sex="male"),
    "35 kg": Measurements({"stature": 1.55, "mass": 35.0}, sex="female"),
}
_GIRTHS = ("chest_girth", "waist_girth", "hip_girth")
_CROUCH_RAD = {"hip": -1.0, "knee": 1.2, "ankle": -0.2}


def extreme_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """From a tape and from a scan."""
    for scene, tape in _TAPES.items():
        yield watch.row(scene, "tape", {}, 0, lambda tape=tape: _from_tape(tape))  # type: ignore[misc]
    if not quick:
        for scene, scan in {"one arm missing": _one_armed, "crouched": _crouched}.items():
            yield watch.row(scene, "scan", {}, 0, lambda scan=scan: _from_scan(scan))  # type: ignore[misc]


def _from_tape(tape: Measurements) -> Measured:
    job = Job()
    body, seconds = clocked(fit_measurements, tape, None, job)
    read = measure(body)
    away: dict[str, Value] = {
        "stature_mm": 1e3 * abs(read.values["stature"] - tape.values["stature"]),
        "mass_kg": abs(read.values["mass"] - tape.values["mass"]),
        "warnings": len(job.warnings),
    }
    return Timing(seconds, 1), away | {f"{name}_interval_mm": 1.96e3 * read.sigmas[name] for name in _GIRTHS}


def _from_scan(scan: Callable[[Avatar], TriangleMesh]) -> Measured:
    body = random_body("female", 0)
    job, config = Job(), ScanConfig.model_validate({"sex": "female"})
    try:
        fitted, seconds = clocked(fit_scan, scan(body), config, job)
    except AvatarError:
        return Timing(0.0), {"outcome": "refused"}
    read, true = measure(fitted), measure(body).values
    away = {name: abs(read.values[name] - true[name]) for name in true if name.endswith("_girth")}
    return Timing(seconds, 1), {
        "outcome": "answered",
        "warnings": len(job.warnings),
        "girths_mae_mm": 1e3 * float(np.mean(list(away.values()))),
        "girths_worst_mm": 1e3 * max(away.values()),
        "inside_interval_share": float(np.mean([wrong <= 1.96 * read.sigmas[name] for name, wrong in away.items()])),
    }


def _one_armed(body: Avatar) -> TriangleMesh:
    arm = (membership("arm") > 0.5) & (body.bind_vertices[:, 0] > 0)
    return submesh(body.mesh, arm[body.faces].sum(axis=1) == 0)[0]


def _crouched(body: Avatar) -> TriangleMesh:
    pose = body.pose.copy()
    pose[:, 0] += [_CROUCH_RAD.get(kind, 0.0) for kind in JOINT_KINDS]
    return pose_avatar(body, pose, body.translation).mesh
