"""The same garment, seen to end and not: over a bare shoulder, and where the rest of it was too dark to scan.

What cameras see is found by another ray caster.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dressed_form import largest, make_scene
from test_openings import arm, sleeve
from test_parted import LENS, STRAPS, around, form, tank_top

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.openings import OpeningsConfig, list_openings
from vto_pipeline.garment.photographed.seen_ends import BEYOND, Scanned, Seen, places_beyond, refuse_unseen_ends
from vto_pipeline.garment.photographed.sightings import SPACING, Sightings
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import concatenate, submesh
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthFrameSet
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.stages.garment import STAGES

CAMERAS = CameraSet(tuple(f"{k}" for k in range(16)), (LENS,) * 16, np.array(around()))


def scan_of(garment, body, dark=None):
    """What two cameras see of a garment on a body; of cloth whose heights are dark they see nothing, nor beneath it."""
    import open3d as o3d

    scene, whole = o3d.t.geometry.RaycastingScene(), concatenate([garment, body])
    scene.add_triangles(whole.vertices.astype(np.float32), whole.faces.astype(np.uint32))
    corners = whole.vertices[whole.faces]
    middle = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.zeros(len(middle), int)
    for eye in CAMERAS.world_from_cam[:, :3, 3]:
        way = middle - eye
        cast = np.column_stack([np.broadcast_to(eye, way.shape), way]).astype(np.float32)
        free = scene.cast_rays(o3d.core.Tensor(cast))["t_hit"].numpy() > 0.999
        seen += free & (np.einsum("nd,nd->n", way, normal) < 0)
    kept = seen >= 2
    of_cloth = np.arange(len(middle)) < len(garment.faces)
    if dark is not None:
        kept &= ~(of_cloth & dark(middle))
    scan, source = submesh(whole, kept)
    is_cloth = source < len(garment.vertices)
    return scan, SurfaceLabels(is_cloth, np.ones(len(is_cloth)))


def seen_by(garment, body, dark=None, sightings=None) -> Seen:
    scan, labels = scan_of(garment, body, dark)
    return Seen(Scanned(scan, CAMERAS), SurfaceDistance(body), BareParts(scan, labels, body), sightings)


def upper(points):
    """Shoulders and neck of the garment."""
    return points[:, 1] > STRAPS - 0.03


@pytest.fixture(scope="module")
def dressed():
    """The form, a top, and the same without what is dark of it."""
    body, top = form(), tank_top()
    low = largest(submesh(top, ~upper(top.vertices[top.faces].mean(axis=1)))[0])
    return body, top, low


def checked(garment, seen, answered=False) -> Job:
    job = Job()
    refuse_unseen_ends(garment, list_openings(garment), seen, answered, job)
    return job


def test_what_was_too_dark_to_scan_leaves_no_neckline(dressed):
    body, top, low = dressed
    length = 1e3 * list_openings(low)[0].perimeter
    with pytest.raises(GarmentError, match=f"of {length:.0f} mm of an opening's rim nothing was seen") as no:
        checked(low, seen_by(top, body, upper))
    assert "openings.keep" in no.value.hint
    assert no.value.partial["garment"] is low


def test_the_same_rim_over_bare_shoulders_is_one(dressed):
    body, _, low = dressed
    assert checked(low, seen_by(low, body)).warnings == []


def test_rims_that_were_seen_to_end_pass(dressed):
    body, top, _ = dressed
    assert checked(top, seen_by(top, body)).warnings == []


def test_photos_that_show_the_form_bare_are_enough(dressed):
    """Stereo sees nothing of a plain form."""
    body, _, low = dressed
    scan, labels = scan_of(low, body)
    cloth, source = submesh(scan, labels.garment[scan.faces].all(axis=1))
    points = sample_surface(body, int(1.0 / SPACING**2), 1)[0]
    bare = BareParts(cloth, SurfaceLabels(labels.garment[source], labels.confidence[source]), body)
    for clothed in (False, True):
        sightings = Sightings(points, np.full(len(points), clothed), SPACING**2)
        seen = Seen(Scanned(cloth, CAMERAS), SurfaceDistance(body), bare, sightings)
        if clothed:
            with pytest.raises(GarmentError, match="nothing was seen"):
                checked(low, seen)
        else:
            assert checked(low, seen).warnings == []


def test_who_gives_the_number_of_openings_is_warned(dressed):
    body, top, low = dressed
    job = checked(low, seen_by(top, body, upper), answered=True)
    assert len(job.warnings) == 1
    assert "nothing was seen" in job.warnings[0]


def test_a_rim_far_from_the_form_is_a_warning():
    """Nothing need be behind it."""
    tube, pole = sleeve(radius=0.25), arm(radius=0.05)
    scan, labels = scan_of(tube, pole)
    cloth = submesh(scan, labels.garment[scan.faces].all(axis=1))[0]
    job = checked(tube, Seen(Scanned(cloth, CAMERAS), SurfaceDistance(pole), None, None))
    assert len(job.warnings) >= 1
    assert "nothing was seen" in job.warnings[0]


def collar(points):
    """Of a shirt."""
    return (points[:, 1] > 0.66) & (np.abs(points[:, 0]) < 0.13)


@pytest.fixture(scope="module")
def shirt():
    """The form, a shirt, what is scanned of both where the collar is dark, and the shirt without that."""
    scene = make_scene(cell=0.01, noise=0.0, holes=0)
    low = largest(submesh(scene.shirt, ~collar(scene.shirt.vertices[scene.shirt.faces].mean(axis=1)))[0])
    return scene.form, scene.shirt, low


@pytest.mark.parametrize("source", ["photos", "depth", "whole", None])
def test_the_stage_refuses_it_whatever_the_cameras(shirt, source):
    body, whole, low = shirt
    scan, labels = scan_of(whole, body, None if source == "whole" else collar)
    inputs = {
        "garment_shell": whole if source == "whole" else low,
        "mannequin_surface": body,
        "garment_surface": scan,
        "garment_placement": np.eye(4),
        "labels": labels,
    }
    if source in ("photos", "whole"):
        inputs["garment_cameras"] = CAMERAS
    elif source == "depth":
        inputs["garment_depth"] = DepthFrameSet(tuple(Path(f"{k}.png") for k in range(16)), (), LENS, 1000.0)
        inputs["garment_trajectory"] = CAMERAS.world_from_cam
    stage, job = {stage.name: stage for stage in STAGES}["openings"], Job()
    assert set(inputs) <= {*stage.needs, *stage.optional}
    settings = OpeningsConfig(look_again=False)
    if source in ("photos", "depth"):
        with pytest.raises(GarmentError, match="nothing was seen"):
            stage.run(inputs, settings, job)
    else:  # a whole shirt, and one of which nobody knows from where it was seen
        assert len(stage.run(inputs, settings, job)["openings"]) == 4
        assert not any("nothing was seen" in text for text in job.warnings)


def test_places_beyond_the_rims_of_a_tube_lie_above_and_below_it():
    tube = sleeve(ragged=0.001)
    for opening in list_openings(tube):
        places, length = places_beyond(tube, opening)
        away = np.where(opening.center[1] > 0.2, places[:, 1] - 0.4, -places[:, 1])
        np.testing.assert_allclose(away, BEYOND, atol=0.004)  # the rim is ragged by 1 mm
        np.testing.assert_allclose(np.hypot(places[:, 0], places[:, 2]), 0.1, atol=0.002)
        np.testing.assert_allclose(length.sum(), opening.perimeter, rtol=1e-6)
