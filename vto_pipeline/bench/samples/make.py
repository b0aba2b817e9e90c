"""The list of sample files, in the order in which they are made."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
from PIL import Image

from vto_pipeline.bench.samples.captures.board import write_board
from vto_pipeline.bench.samples.captures.cloud import around_stations, scan_stations
from vto_pipeline.bench.samples.captures.depth import around, write_depth_frames
from vto_pipeline.bench.samples.captures.photos import exposed, write_photos
from vto_pipeline.bench.samples.captures.render import SUIT, Surface, build_scene, render
from vto_pipeline.bench.samples.captures.studio import dressed_form
from vto_pipeline.bench.samples.captures.viewpoints import looking_at
from vto_pipeline.bench.samples.customer import make_customer, measure_truth
from vto_pipeline.bench.samples.garments.shirt import make_hanging_shirt
from vto_pipeline.bench.samples.solids.form import Form, make_form
from vto_pipeline.io.bodies.measurements import write_measurements
from vto_pipeline.io.captures.cameras import write_cameras, write_trajectory
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.files import replacing
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Measurements
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import PointCloud, TriangleMesh

PARTS = ("photos", "depth", "cloud", "customer")
FORM_CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
BODY_CAMERA = Intrinsics(480, 640, 525.0, 525.0, 239.5, 319.5)
PORTRAIT = Intrinsics(540, 720, 900.0, 900.0, 269.5, 359.5)
FORM_FRAMES, BODY_FRAMES = 60, 30
MESH_CELL = 0.012
"""Edge of the shirt as a finished mesh, such as a designer hands over [m]."""
# Near which point of the shirt the laser saw nothing [m], and how wide [m].
HOLES = (
    ((0.17, 0.52, 0.0), 0.050),
    ((0.02, 0.42, -0.12), 0.040),
    ((-0.07, 0.58, 0.14), 0.020),
    ((-0.16, 0.33, 0.06), 0.030),
)


def make_samples(out: Path, parts: Collection[str] = PARTS, say: Callable[[str], None] = lambda text: None) -> None:
    """Write sample data and their truth.

    Args:
        out: The folder, `sample_data` in the repository.
        parts: Which of PARTS to make; form and shirt are always made.
        say: Receives what is being done.
    """
    say("form and shirt")
    form = make_form()
    form = Form(form.shape, rounded(form.mesh))
    shirt = rounded(make_hanging_shirt(form))
    write_ply(out / "shirt_on_form" / "form.ply", form.mesh)
    write_ply(out / "truth" / "shirt.ply", shirt)
    write_ply(out / "shirt_on_form" / "shirt.ply", rounded(make_hanging_shirt(form, MESH_CELL)))
    scene = dressed_form(form, shirt)
    if "photos" in parts:
        say("photos of the form")
        write_board(out / "shirt_on_form" / "photos" / "board.yaml")
        cameras = write_photos(out / "shirt_on_form" / "photos", scene)
        write_cameras(out / "truth" / "photo_cameras.json", cameras)
    if "depth" in parts:
        say("depth frames of the form")
        poses = around(FORM_FRAMES, 390.0, 1.15, 0.45, (-4.0, 22.0))
        write_depth_frames(out / "shirt_on_form" / "depth", scene, FORM_CAMERA, poses, seed=100)
        write_trajectory(out / "truth" / "depth_trajectory.json", poses)
    if "cloud" in parts:
        say("laser cloud of the form")
        nearest = [np.linalg.norm(shirt.vertices - near, axis=1).argmin() for near, _ in HOLES]
        holes = [(shirt.vertices[i], diameter) for i, (_, diameter) in zip(nearest, HOLES, strict=True)]
        stations = around_stations(6, 1.5, (0.45, 0.40, 0.45), (-12.0, 15.0, 50.0))
        cloud = scan_stations(scene, stations, holes, count=60_000, seed=200)
        write_ply(out / "shirt_on_form" / "cloud.ply", transform_cloud(cloud, cloud_from_form()))
        record = {"cloud_from_form": cloud_from_form(), "holes": [{"center": c, "diameter": d} for c, d in holes]}
        write_json(out / "truth" / "cloud.json", record)
    if "customer" in parts:
        say("the customer")
        make_customer_samples(out / "customer", out / "truth")


def make_customer_samples(folder: Path, truth: Path) -> None:
    """Write all that is known of the customer to `folder` and the body to `truth`."""
    body = rounded(make_customer())
    measured = measure_truth(body)
    write_ply(truth / "customer_body.ply", body)
    write_measurements(truth / "customer_measurements.json", measured)
    write_tape(folder / "measurements.yaml", measured)
    scene = build_scene([Surface(body, SUIT)])

    poses = around(BODY_FRAMES, 372.0, 1.65, 0.82, (-6.0, 14.0))
    write_depth_frames(folder / "depth", scene, BODY_CAMERA, poses, seed=300)
    write_trajectory(folder / "depth" / "poses.json", poses)
    stations = around_stations(5, 1.9, (0.9, 0.7, 0.9), (-18.0, 8.0, 40.0))
    write_ply(folder / "cloud.ply", scan_stations(scene, stations, [], count=40_000, seed=400))

    target = np.array([0.0, 0.85, 0.0])
    for index, (name, eye) in enumerate((("front", [0.0, 1.0, 2.5]), ("side", [2.5, 1.0, 0.0]))):
        picture = exposed(render(scene, PORTRAIT, looking_at(np.array(eye), target)), 500 + index, noise=1.0 / 255.0)
        with replacing(folder / "silhouettes" / f"{name}.png") as beside:
            Image.fromarray(picture).save(beside, compress_level=9)
    with replacing(folder / "silhouettes" / "stature.yaml") as beside:
        beside.write_text(f"stature: {measured.values['stature']:.3f}\nunit: m\n", encoding="utf-8")


def write_tape(path: Path, measured: Measurements) -> None:
    """Write a tape's protocol in centimetres."""
    lines = [f"sex: {measured.sex}", "unit: cm", "measurements:"]
    lines += [f"  {name}: {100.0 * value:.1f}" for name, value in measured.values.items()]
    with replacing(path) as beside:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")


def cloud_from_form() -> FloatArray:
    """Where the laser's frame is: turned about the vertical, and elsewhere; shape (4, 4)."""
    turn = np.deg2rad(37.0)
    matrix = np.eye(4)
    matrix[:3, :3] = [[np.cos(turn), 0.0, np.sin(turn)], [0.0, 1.0, 0.0], [-np.sin(turn), 0.0, np.cos(turn)]]
    matrix[:3, 3] = [0.42, 0.05, -0.31]
    return matrix


def transform_cloud(cloud: PointCloud, matrix: FloatArray) -> PointCloud:
    """The cloud in another frame, rounded to a hundredth of a millimetre."""
    return PointCloud(np.round(cloud.points @ matrix[:3, :3].T + matrix[:3, 3], 5))


def rounded(mesh: TriangleMesh) -> TriangleMesh:
    """To the micrometre, so that the last bits of a processor's arithmetic do not reach the files."""
    return TriangleMesh(np.round(mesh.vertices, 6), mesh.faces, mesh.colors)
