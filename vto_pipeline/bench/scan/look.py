"""How a textured garment looks beside photos that it was not made from.

`python -m vto_pipeline.bench.scan.look RUN` takes a run from photos and leaves some of them out. It makes the texture
again from the others, draws the garment where the left-out photos were taken, and compares. The cameras and the surface
are the run's own, from all photos. Open3D's `project_images_to_albedo` gets the same surface, charts and photos.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.bench.scan.likeness import likeness, seam_steps
from vto_pipeline.geometry.rigid import transform_cameras, transform_mesh
from vto_pipeline.geometry.topology import face_area_vectors
from vto_pipeline.io.captures.cameras import read_cameras, read_matrix
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.photos import read_photos
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.io.runs.garments import read_labels
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.numerics.rasterise import rasterise
from vto_pipeline.scan.texture.project import TextureConfig, texture_surface
from vto_pipeline.scan.texture.views import look

SAMPLES = 3
"""Per pixel and direction, of a drawn picture."""

CLEAR_PX = 2.0
"""Pixels nearer to the garment's outline are not compared: they show something else in part."""


class Capture(NamedTuple):
    """A run from photos.

    Args:
        garment: The surface [m].
        occluder: All that was scanned [m].
        photos: Their files.
        cameras: In the frame of the garment.
        form: Colours of what was scanned beside the garment, shape (B, 3), or None.
    """

    garment: TriangleMesh
    occluder: TriangleMesh
    photos: PhotoSet
    cameras: CameraSet
    form: ByteArray | None


def read_capture(run: Path) -> Capture:
    """Read what the texture of a run is made from."""
    out = run / "out"
    cameras, surface = read_cameras(out / "cameras.json"), read_own_mesh(out / "surface.ply")
    if (out / "garment_placement.json").is_file():
        placement = read_matrix(out / "garment_placement.json", "mannequin_from_surface").reshape(4, 4)
        cameras, surface = transform_cameras(cameras, placement), transform_mesh(surface, placement)
    given = read_json(run / "run.json")["given"]
    photos = read_photos(Path(given["garment_photos"]["path"]))
    form = None
    if (out / "labels.npz").is_file() and surface.colors is not None:
        form = surface.colors[~read_labels(out / "labels.npz").garment]
    return Capture(read_own_mesh(out / "garment.ply"), surface, photos, cameras, form)


def measure_look(capture: Capture, held: int, config: TextureConfig, folder: Path | None = None) -> dict[str, Any]:
    """Return how like the left-out photos the garment is, ours and Open3D's.

    Args:
        capture: What a run made.
        held: How many photos are left out, evenly.
        config: Of the texture.
        folder: Where each left-out photo is written beside ours and Open3D's, or None.
    """
    count = len(capture.cameras.names)
    out = np.unique(np.rint((np.arange(held) + 0.5) * count / held).astype(int))
    kept = np.setdiff1d(np.arange(count), out)
    job = Job()
    began = time.perf_counter(), time.process_time()
    ours = texture_surface(
        capture.garment, capture.occluder, capture.photos, choose(capture.cameras, kept), config, job, capture.form
    )
    spent = time.perf_counter() - began[0], time.process_time() - began[1]
    found: dict[str, Any] = {"held_out": [capture.cameras.names[k] for k in out], **job.metrics}
    found["ours"] = {"seconds": spent[0], "cpu_seconds": spent[1], **_compare(capture, ours, out, config)}
    began = time.perf_counter(), time.process_time()
    theirs = _open3d(ours, capture, kept)
    spent = time.perf_counter() - began[0], time.process_time() - began[1]
    found["open3d"] = {"seconds": spent[0], "cpu_seconds": spent[1], **_compare(capture, theirs, out, config)}
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        _draw_beside(capture, (ours, theirs), out, folder)
    return found


def choose(cameras: CameraSet, which: NDArray[np.int64]) -> CameraSet:
    """Return some of the cameras."""
    return CameraSet(
        tuple(cameras.names[k] for k in which),
        tuple(cameras.intrinsics[k] for k in which),
        cameras.world_from_cam[which],
        cameras.metric,
    )


def draw(textured: TexturedMesh, camera: Intrinsics, world_from_cam: FloatArray) -> tuple[ByteArray, NDArray[np.bool_]]:
    """Draw a textured mesh, unlit, as a camera without distortion sees it.

    Returns:
        sRGB, shape (H, W, 3), and which pixels show the outside, and texels that a photo had shown, shape (H, W).
    """
    fine = camera.without_distortion().resized(SAMPLES * camera.width, SAMPLES * camera.height)
    cam_from_world = np.linalg.inv(world_from_cam)
    local = textured.mesh.vertices @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
    z = np.maximum(local[:, 2], 1e-6)
    placed = np.column_stack([fine.fx * local[:, 0] / z + fine.cx, fine.fy * local[:, 1] / z + fine.cy, z])
    face, weight, _ = rasterise(placed[textured.mesh.faces], fine.width, fine.height)
    shown = face >= 0
    share = np.column_stack([1.0 - weight[shown].sum(axis=1), weight[shown]])
    corner = 1.0 / z[textured.mesh.faces[face[shown]]]  # interpolated as perspective has it
    share = share * corner / (share * corner).sum(axis=1, keepdims=True)
    assert textured.mesh.texture is not None
    place = np.einsum("nk,nkd->nd", share, textured.mesh.texture[face[shown]])
    outside = (
        face_area_vectors(textured.mesh) * (world_from_cam[:3, 3] - textured.mesh.vertices[textured.mesh.faces[:, 0]])
    ).sum(axis=1) > 0
    picture, seen = np.zeros((fine.height, fine.width, 3)), np.zeros((fine.height, fine.width))
    picture[shown] = sample(textured.picture, place)
    seen[shown] = sample(np.where(textured.seen, 255, 0).astype(np.uint8)[..., None], place)[:, 0] > 128
    seen[shown] *= outside[face[shown]]
    block = (camera.height, SAMPLES, camera.width, SAMPLES)
    whole = seen.reshape(block).min(axis=(1, 3)) > 0
    return np.rint(picture.reshape(*block, 3).mean(axis=(1, 3))).astype(np.uint8), whole


def sample(picture: ByteArray, place: FloatArray) -> FloatArray:
    """Return a picture's colours at texture coordinates, v up, bilinearly, shape (N, D)."""
    import cv2

    height, width = picture.shape[:2]
    x = (place[:, 0] * width - 0.5).astype(np.float32)
    y = ((1.0 - place[:, 1]) * height - 0.5).astype(np.float32)
    rows = -(-len(x) // 30_000)  # cv2 takes no longer columns
    columns, lines = (np.resize(one, (rows, 30_000)) for one in (x, y))
    found = cv2.remap(picture, columns, lines, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, dtype=np.float64).reshape(rows * 30_000, -1)[: len(x)]


def _compare(capture: Capture, textured: TexturedMesh, out: NDArray[np.int64], config: TextureConfig) -> dict[str, Any]:
    paths = {path.name: path for path in capture.photos.paths}
    each = []
    for k in out:
        camera, pose = capture.cameras.intrinsics[k], capture.cameras.world_from_cam[k]
        photo = undistorted(read_image(paths[capture.cameras.names[k]]), camera)
        picture, seen = draw(textured, camera, pose)
        view = look(textured.mesh, capture.occluder, camera, pose, 1e-3 * config.slack_mm)
        each.append(likeness(photo, picture, seen & (view.inside > CLEAR_PX)))
    mean = {name: float(np.mean([one[name] for one in each])) for name in each[0]}
    worst = {f"{name}_worst": float(min(one[name] for one in each)) for name in ("psnr_db", "ssim", "sharpness")}
    return {**mean, **worst, **seam_steps(textured, sample)}


def _draw_beside(capture: Capture, textured: Sequence[TexturedMesh], out: NDArray[np.int64], folder: Path) -> None:
    from PIL import Image

    paths = {path.name: path for path in capture.photos.paths}
    for k in out:
        camera, pose, name = capture.cameras.intrinsics[k], capture.cameras.world_from_cam[k], capture.cameras.names[k]
        beside = [undistorted(read_image(paths[name]), camera)] + [draw(one, camera, pose)[0] for one in textured]
        Image.fromarray(np.hstack(beside)).save(folder / f"{Path(name).stem}.png")
    for one, name in zip(textured, ("ours", "open3d"), strict=True):
        Image.fromarray(one.picture).save(folder / f"texture_{name}.png")


def _open3d(ours: TexturedMesh, capture: Capture, kept: NDArray[np.int64]) -> TexturedMesh:
    """Return the same charts with the picture that Open3D projects from the same photos."""
    import open3d as o3d

    mesh = o3d.t.geometry.TriangleMesh(
        o3d.core.Tensor.from_numpy(ours.mesh.vertices.astype(np.float32)),
        o3d.core.Tensor.from_numpy(ours.mesh.faces.astype(np.int64)),
    )
    assert ours.mesh.texture is not None
    mesh.triangle.texture_uvs = o3d.core.Tensor.from_numpy(ours.mesh.texture.astype(np.float32))
    paths = {path.name: path for path in capture.photos.paths}
    cameras = choose(capture.cameras, kept)
    pictures, inner, outer = [], [], []
    for name, camera, pose in zip(cameras.names, cameras.intrinsics, cameras.world_from_cam, strict=True):
        pictures.append(o3d.t.geometry.Image(np.ascontiguousarray(undistorted(read_image(paths[name]), camera))))
        inner.append(o3d.core.Tensor.from_numpy(camera.matrix))
        outer.append(o3d.core.Tensor.from_numpy(np.ascontiguousarray(np.linalg.inv(pose))))
    size = max(ours.picture.shape[:2])
    albedo = np.asarray(mesh.project_images_to_albedo(pictures, inner, outer, size, False).as_tensor().numpy())
    return replace(ours, picture=np.ascontiguousarray(albedo[..., :3]), seen=np.ones(albedo.shape[:2], dtype=bool))


def main() -> None:
    """Read the command line, measure, and put the figures on stdout."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scan.look", description=__doc__)
    parser.add_argument("run", type=Path, help="a run of `vto scan` or of a document, from photos")
    parser.add_argument("--held-out", type=int, default=4, metavar="N", help="photos that are left out")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="settings of the texture")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="for pictures beside the photos")
    arguments = parser.parse_args()
    config = TextureConfig.model_validate(dict(pair.split("=", 1) for pair in arguments.set))
    found = measure_look(read_capture(arguments.run), arguments.held_out, config, arguments.pictures)
    json.dump(found, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
