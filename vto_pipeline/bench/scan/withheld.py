"""`python -m vto_pipeline.bench.scan.withheld` parts garment and form again in finished scans, without the form's scan.

Each capture was scanned by `python -m vto_pipeline.bench.scan`. Its form is known by a tape, by its stature only, or,
to compare, by its own scan. Bar: intersection over union of the garment of at least 0.95.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.assess.surface import face_areas, vertex_areas
from vto_pipeline.avatar.from_dressed import fit_dressed
from vto_pipeline.avatar.from_scan import ScanConfig
from vto_pipeline.avatar.measure import measure
from vto_pipeline.avatar.scan.report import extremity_weights
from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.scan.captures import FORM, KINDS, TRUTH
from vto_pipeline.errors import VtoError
from vto_pipeline.garment.subtraction.estimated import label_over_estimate
from vto_pipeline.garment.subtraction.pieces import may_be_worn
from vto_pipeline.garment.subtraction.subtract import SubtractConfig, label_garment
from vto_pipeline.geometry.closest import barycentric
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import edge_face_counts, submesh
from vto_pipeline.io.captures.cameras import read_placement
from vto_pipeline.io.meshes import read_mesh, read_own_mesh
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

TAPE = (
    *("stature", "inside_leg", "outer_arm_length", "neck_girth", "chest_girth", "waist_girth", "hip_girth"),
    *("upper_arm_girth", "thigh_girth"),
)
"""What a studio would measure of its form."""
KNOWN = {"scan": (), "tape": TAPE, "stature": ("stature",)}

_NEAR = 0.012  # of the true garment, noise included [m]
_COLUMNS = ("capture", "known", "iou", "missed", "false", "cpu_s", "bare_ends_share", "colors_alike", "reason")


def true_garment(surface: TriangleMesh, garment: TriangleMesh, form: TriangleMesh) -> NDArray[np.bool_]:
    """Return which vertices of a scan are of the garment, shape (V,).

    Where the garment covers the form, it is what was seen, however close it lies. Beyond a rim the nearer one counts.

    Args:
        surface: In the frame of the others [m].
        garment: Open shell.
        form: Bare.
    """
    near, bare = SurfaceDistance(garment).nearest(surface.vertices), SurfaceDistance(form).nearest(surface.vertices)
    pair, count = edge_face_counts(garment)
    rim = np.zeros(len(garment.vertices), dtype=bool)
    rim[pair[count == 1].ravel()] = True
    corners = garment.faces[near.face]
    shares = barycentric(near.point, garment.vertices[corners])
    beyond = (shares * rim[corners]).sum(axis=1) > 0.999
    return (near.distance < _NEAR) & (~beyond | (near.distance < bare.distance))


def worn_pieces(surface: TriangleMesh, garment: NDArray[np.bool_], form: TriangleMesh) -> NDArray[np.bool_]:
    """Return which vertices belong to pieces of what is labelled garment that may be worn: they are kept."""
    part, source = submesh(surface, np.asarray(garment[surface.faces].all(axis=1)))
    kept = np.zeros(len(surface.vertices), dtype=bool)
    kept[source[part.faces[may_be_worn(part, SurfaceDistance(form))].ravel()]] = True
    return kept


def withheld_row(capture: Path, run: Path, known: str, sex: str) -> dict[str, Value]:
    """Return how well garment and form are parted in a finished scan.

    Args:
        capture: Folder with the form and the true garment.
        run: Folder of its scan.
        known: Of `KNOWN`.
        sex: Of the form.
    """
    out = run / "out"
    surface = read_own_mesh(out / "surface.ply")
    form = read_mesh(capture / FORM)
    placed = transform_mesh(surface, read_placement(out / "garment_placement.json"))
    true = true_garment(placed, read_mesh(capture / TRUTH), form)
    area = vertex_areas(face_areas(placed.vertices, placed.faces), placed.faces, len(placed.vertices))
    job, began = Job(), time.process_time()
    row: dict[str, Value] = {"capture": capture.name, "known": known}
    try:
        labels = _labels(surface, placed, form, known, sex, job)
    except VtoError as error:
        return row | {"reason": error.problem}
    found = worn_pieces(placed, labels.garment, form)
    whole = float(area[true].sum())
    said: dict[str, Value] = {
        name: float(str(job.metrics[name])) for name in ("bare_ends_share", "colors_alike") if name in job.metrics
    }
    return row | {
        "iou": float(area[found & true].sum() / area[found | true].sum()),
        "missed": float(area[true & ~found].sum()) / whole,
        "false": float(area[found & ~true].sum()) / whole,
        "cpu_s": time.process_time() - began,
        **said,
    }


def _labels(
    surface: TriangleMesh, placed: TriangleMesh, form: TriangleMesh, known: str, sex: str, job: Job
) -> SurfaceLabels:
    if known == "scan":
        return label_garment(placed, form, SubtractConfig.model_validate({}), job)
    values = measure(form).values
    tape = Measurements({name: values[name] for name in KNOWN[known]}, sex=sex)
    body = fit_dressed(surface, tape, ScanConfig(), job)
    return label_over_estimate(surface, body.mesh, extremity_weights(body), SubtractConfig.model_validate({}), job)


def main() -> None:
    """Read the command line and print a row each."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scan.withheld", description=__doc__)
    parser.add_argument("capture", type=Path, nargs="+", help="capture folders")
    parser.add_argument("--runs", type=Path, default=Path("runs/scans"), metavar="DIR", help="of the scans")
    parser.add_argument("--kind", choices=KINDS, default="depth", help="what was scanned from")
    parser.add_argument("--known", choices=list(KNOWN), nargs="+", default=list(KNOWN), help="of the form")
    parser.add_argument("--sex", choices=["female", "male", "neutral"], default="neutral", help="of the form")
    parser.add_argument("--out", type=Path, default=Path("runs/withheld"), metavar="DIR", help="for rows.jsonl")
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    for capture in arguments.capture:
        run = arguments.runs / f"{capture.name}_{arguments.kind.partition('.')[0]}"
        for known in arguments.known:
            table.add(withheld_row(capture, run, known, arguments.sex))


if __name__ == "__main__":
    main()
