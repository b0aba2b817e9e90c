"""The bench of bodies: its second tape, its poor scans and its picture."""

from io import BytesIO

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from PIL import Image
from scipy.spatial import cKDTree

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.bench import BENCHES
from vto_pipeline.bench.body.coverage import interval_errors
from vto_pipeline.bench.body.iso20685 import CLASSES, LIMITS_MM
from vto_pipeline.bench.body.people import as_standing, poor_scan, random_body
from vto_pipeline.bench.body.silhouettes import photograph
from vto_pipeline.bench.body.slices import slice_girth
from vto_pipeline.bench.plots.body_plot import draw_body
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.mesh import TriangleMesh


def test_the_second_tape_spans_hollows() -> None:
    """Two posts joined by a web: the taut tape is the hull of the section; a third post apart is not in it."""
    web = trimesh.creation.box((0.4, 1.0, 0.1))
    ends = [
        trimesh.creation.box((0.1, 1.0, 0.3), trimesh.transformations.translation_matrix((x, 0, 0)))
        for x in (-0.2, 0.2)
    ]
    body = trimesh.boolean.union([web, *ends])
    arm = trimesh.creation.box((0.1, 1.0, 0.1), trimesh.transformations.translation_matrix((0.6, 0, 0)))
    whole = trimesh.util.concatenate([body, arm])
    mesh = TriangleMesh(whole.vertices, whole.faces)
    assert_allclose(slice_girth(mesh, 0.1), 2 * (0.5 + 0.3), rtol=0, atol=1e-6)  # trimesh joins segments to 1e-8
    with pytest.raises(InputError, match="height of 3"):
        slice_girth(mesh, 3.0)


def test_the_second_tape_goes_round_a_trunk_whose_arms_are_cut_off() -> None:
    """An arm grown to the trunk is part of its loop; without it the section is in two pieces, and both count."""
    trunk = trimesh.creation.box((0.4, 1.0, 0.3))
    arm = trimesh.creation.box((0.2, 0.2, 0.1), trimesh.transformations.translation_matrix((0.3, 0, 0)))
    other = arm.copy()
    other.apply_translation((-0.6, 0, 0))
    body = trimesh.boolean.union([trunk, arm, other])
    beside = (np.abs(body.triangles_center[:, 0]) > 0.19999) & (np.abs(body.triangles_center[:, 1]) < 0.1001)
    assert_allclose(
        slice_girth(TriangleMesh(body.vertices, body.faces), 0.01),
        2 * (np.hypot(0.2, 0.1) * 2 + 0.5),
        rtol=0,
        atol=1e-6,
    )
    armless = TriangleMesh(body.vertices, body.faces[~beside])
    assert_allclose(slice_girth(armless, 0.01, armless=True), 2 * (0.4 + 0.3), rtol=0, atol=1e-6)


def test_a_poor_scan_is_as_poor_as_it_says() -> None:
    body = random_body("female", 4)
    cloud = poor_scan(body, 4, count=6000)
    assert len(cloud.points) == 6000
    away = closest_points(cloud.points[:5700], body.vertices, body.faces)[2]
    # of isotropic noise the surface sees one direction: rms 2 mm, a little less where it is curved
    assert_allclose(np.sqrt((away**2).mean()), 2e-3, rtol=0.05)
    bare = cKDTree(cloud.points[:5700]).query(body.vertices)[0]
    assert 0.03 < (bare > 0.025).mean() < 0.15, "a tenth of the surface has no points, less the holes' rims"


def test_a_person_as_they_stand_is_the_same_surface_with_the_arms_put_aside() -> None:
    body = random_body("male", 5)
    kept = as_standing(body)
    assert_allclose(kept.vertices, body.vertices, rtol=0, atol=1e-6)
    cos, sin = np.cos(body.pose[0, 1]), np.sin(body.pose[0, 1])
    facing = body.vertices @ np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    trunk = body.weights[:, [body.joint_names.index(name) for name in ("pelvis", "spine")]].sum(axis=1) > 0.999
    away = (kept.bind_vertices - facing)[trunk]
    assert np.ptp(away, axis=0).max() < 1e-3, "a trunk only turns to the front"


def test_intervals_of_normal_errors_hold_95_percent() -> None:
    """Errors drawn with the spread that is told: 95 % inside; told half as large: 67.3 %."""
    rng, pairs = np.random.default_rng(7), []
    for _ in range(400):
        sigmas = dict.fromkeys(DEFINITIONS, 0.004)
        spread = {name: 0.008 if what.kind == "height" else 0.004 for name, what in DEFINITIONS.items()}
        off = {name: float(rng.normal(0.0, size)) for name, size in spread.items()}
        pairs.append((Measurements({name: 1.0 + away for name, away in off.items()}, sigmas), dict.fromkeys(off, 1.0)))
    row = interval_errors(pairs)
    assert_allclose(row["girths_inside_share"], 0.95, rtol=0, atol=0.01)
    assert_allclose(row["heights_inside_share"], 0.673, rtol=0, atol=0.03)
    assert_allclose([row["calf_girth_rms_mm"], row["calf_girth_interval_mm"]], [4.0, 1.96 * 4.0], rtol=0.1)


def test_the_picture_of_a_body_is_in_perspective() -> None:
    """A thin post of 1.6 m at 2.5 m: as tall in pixels as the pinhole says."""
    post = trimesh.creation.box((0.1, 1.6, 0.1), trimesh.transformations.translation_matrix((0, 0.8, 0)))
    image = photograph(TriangleMesh(post.vertices, post.faces), 0.0, 2.5, 0)
    rows = np.flatnonzero((image.mean(axis=2) < 150).any(axis=1))
    focal = 0.85 * 800 * 2.3 / 1.6
    assert_allclose(len(rows), focal * 1.6 / 2.45, rtol=0, atol=2)  # its front face is 5 cm nearer


def test_every_class_of_the_standard_has_measurements_of_ours() -> None:
    assert set(CLASSES) == set(LIMITS_MM)
    assert {name for names in CLASSES.values() for name in names} <= set(DEFINITIONS)


def test_the_plot_takes_every_kind_of_row() -> None:
    def row(scene: str, method: str, seconds: float, **errors: float) -> dict[str, object]:
        return {"scene": scene, "method": method, "seconds": seconds, "errors": errors}

    scans = [row("a", "points", s, surface_mean_mm=1 / s, girth_mm=3 / s) for s in (1.0, 2.0)]
    others = [
        row("large girths", "repeated scan", 1.0, spread_mm=0.4, group_limit_mm=9.0),
        row("female", "tape", 1.0, asked_mm=0.2, unasked_mae_mm=9.0, unasked_mae_by_the_mean_mm=20.0),
        row("male", "silhouettes", 1.0, chest_girth_mae_mm=9.0, inside_interval_share=0.9),
        row("drawn", "scan", 1.0, girths_inside_share=0.96, calf_girth_inside_share=0.9),
    ]
    whole = Image.open(BytesIO(draw_body({"bench": "body", "rows": scans + others})))
    half = Image.open(BytesIO(draw_body({"bench": "body", "rows": others})))
    assert whole.size == (2400, 3 * 680)
    assert half.size == (2400, 2 * 680)
    with pytest.raises(InputError, match="none of a body"):
        draw_body({"bench": "body", "rows": [row("x", "y", 1.0, other=1.0)]})
    assert BENCHES["body"].draw is draw_body
