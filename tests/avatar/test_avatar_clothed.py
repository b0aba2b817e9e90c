"""A person who is known, dressed in a loose shirt and trousers, seen by cameras all round."""

import json

import numpy as np
import open3d as o3d
import pytest
import trimesh
from body_judges import distances, inside

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.measure import measure
from vto_pipeline.bench.body.people import drawn
from vto_pipeline.bench.samples.top import make_shirt
from vto_pipeline.bench.samples.trousers import make_trousers
from vto_pipeline.bench.samples.wearer import Wearer
from vto_pipeline.io.bodies import write_measurements
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

GIRTHS = ("chest", "underbust", "waist", "navel", "hip", "thigh", "neck", "upper_arm", "forearm", "wrist", "ankle")
EASE = 0.020  # at the least, in radius: 13 cm of girth


def dressed(body: Avatar) -> TriangleMesh:
    wearer = Wearer(body)
    clothes = [make_shirt(wearer, 14.0, ease=EASE).mesh, make_trousers(wearer, 14.0, ease=0.012).mesh]
    parts = [trimesh.Trimesh(m.vertices, m.faces, process=False) for m in (body.mesh, *clothes)]
    whole = trimesh.util.concatenate(parts)
    seen = trimesh.Trimesh(whole.vertices, whole.faces[seen_from_around(whole)], process=False)
    seen.remove_unreferenced_vertices()
    return TriangleMesh(seen.vertices, seen.faces)


def seen_from_around(mesh: trimesh.Trimesh) -> np.ndarray:
    """Whether a camera 2.2 m away, at one of four heights, sees a face's middle."""
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(mesh.vertices.astype(np.float32)),
        o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)),
    )
    seen = np.zeros(len(mesh.faces), dtype=bool)
    for turn in np.arange(16) * np.pi / 8:
        for height in (0.3, 0.9, 1.5, 2.2):
            eye = np.array([2.2 * np.sin(turn), height, 2.2 * np.cos(turn)])
            rays = np.concatenate([np.broadcast_to(eye, (len(seen), 3)), mesh.triangles_center - eye], axis=1)
            hit = scene.cast_rays(o3d.core.Tensor.from_numpy(rays.astype(np.float32)))["t_hit"].numpy()
            seen |= hit > 1 - 2e-3
    return seen


@pytest.mark.slow
@pytest.mark.parametrize(("sex", "seed"), [("female", 100), ("male", 101)])
def test_the_body_inside_loose_clothes(sex: str, seed: int, tmp_path) -> None:
    known = {k: v for k, v in drawn(sex, seed).values.items() if k.endswith("_girth") or k in ("stature", "inside_leg")}
    body = fit_measurements(Measurements(known, sex=sex))
    scan = dressed(body)
    job = Job()
    found = fit_scan(scan, ScanConfig(sex=sex, clothed=True), job)
    read, true = measure(found), measure(body).values
    wrong = {row: read.values[f"{row}_girth"] - true[f"{row}_girth"] for row in GIRTHS}
    assert abs(wrong["chest"]) < 0.05, wrong  # the shirt is 13 cm larger there
    away = {row: abs(wrong[row]) / read.sigmas[f"{row}_girth"] for row in GIRTHS}
    assert max(away.values()) < 3.0, (wrong, away)
    assert np.mean([one < 1.96 for one in away.values()]) > 0.8, (wrong, away)
    # skin shows, and is no estimate
    assert max(abs(wrong[row]) for row in ("forearm", "wrist")) < 0.008, wrong
    assert job.metrics["tangled_faces"] == 0
    assert job.metrics["estimated_under_clothing"] is True
    assert any("under clothing" in warning for warning in job.warnings)
    write_measurements(tmp_path / "measurements.json", read)
    assert json.loads((tmp_path / "measurements.json").read_text())["caveats"][0] == "estimated under clothing"
    # what of it is outside the clothes is so by little
    trunk = found.vertices[np.unique(found.loops["chest"])]
    assert distances(trunk, scan.vertices, scan.faces)[~inside_clothes(trunk, scan)].max(initial=0.0) < 0.005


def inside_clothes(points: np.ndarray, scan: TriangleMesh) -> np.ndarray:
    """By the solid angle; the scan is open at the hems, so that half of a turn is not a sharp limit but a fair one."""
    return inside(points, scan.vertices, scan.faces)
