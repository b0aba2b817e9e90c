"""How a textured garment looks beside photos that it was not made from.

`python -m vto_pipeline.bench.scan.look RUN...` takes runs from photos and leaves some out. It makes the texture
again from the others, draws the garment where the left-out photos were taken, and compares. The cameras and the surface
are the run's own, from all photos. Beside it stand the colours at the scan's vertices, which all photos gave, and
Open3D's `project_images_to_albedo`, which gets the same surface, charts and photos. All are compared at the same
pixels.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.bench.scan.drawn import draw, draw_vertex_colors, sample
from vto_pipeline.bench.scan.likeness import likeness, seam_steps
from vto_pipeline.geometry.rigid import transform_cameras, transform_mesh
from vto_pipeline.io.captures.cameras import read_cameras, read_placement
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.photos import read_photos
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.io.documents import read_json
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.io.runs.garments import read_labels
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.scan.texture.project import TextureConfig, texture_surface
from vto_pipeline.scan.texture.views import look

BARS = {"psnr_levelled_db": 26.0, "ssim": 0.85, "sharpness": 0.80}
"""The least likeness that is good enough, on average over the left-out photos.

The exposure and white balance of a left-out photo are its own, and no texture can know them: they are fitted. The rows
have the PSNR without that, too.
"""

CLEAR_PX = 2.0
"""Pixels nearer to the garment's outline are not compared: they show something else in part."""

_COLUMNS = (
    *("run", "method", "psnr_levelled_db", "psnr_db", "exposure_ev", "white_balance_ev", "ssim", "sharpness"),
    *("wrong_share", "compared_share"),
    *("seam_step_p95", "seconds", "missed"),
)


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
        placement = read_placement(out / "garment_placement.json")
        cameras, surface = transform_cameras(cameras, placement), transform_mesh(surface, placement)
    given = read_json(run / "run.json")["given"]
    photos = read_photos(Path(given["garment_photos"]["path"]))
    form = None
    if (out / "labels.npz").is_file() and surface.colors is not None:
        form = surface.colors[~read_labels(out / "labels.npz").garment]
    return Capture(read_own_mesh(out / "garment.ply"), surface, photos, cameras, form)


def measure_look(capture: Capture, held: int, config: TextureConfig, folder: Path) -> list[dict[str, Value]]:
    """Return how like the left-out photos the garment is: with our texture, its vertices' colours, Open3D's texture.

    Args:
        capture: What a run made.
        held: How many photos are left out, evenly.
        config: Of the texture.
        folder: Where each left-out photo is written beside these three.

    Returns:
        One row for each: "method", "seconds" and the figures of `likeness` and `seam_steps`; "missed" names the bars
        that it misses.
    """
    count = len(capture.cameras.names)
    out = np.unique(np.rint((np.arange(held) + 0.5) * count / held).astype(int))
    kept = np.setdiff1d(np.arange(count), out)
    began = time.perf_counter()
    ours = texture_surface(
        capture.garment, capture.occluder, capture.photos, choose(capture.cameras, kept), config, Job(), capture.form
    )
    spent = time.perf_counter() - began
    began = time.perf_counter()
    theirs = _open3d(ours, capture, kept)
    seconds = {"texture": spent, "open3d": time.perf_counter() - began}
    found: dict[str, list[dict[str, float]]] = {"texture": [], "vertex_colors": [], "open3d": []}
    paths = {path.name: path for path in capture.photos.paths}
    for k in out:
        name, camera, pose = capture.cameras.names[k], capture.cameras.intrinsics[k], capture.cameras.world_from_cam[k]
        photo = undistorted(read_image(paths[name]), camera)
        picture, seen = draw(ours, camera, pose)
        pictures = {"texture": picture, "vertex_colors": draw_vertex_colors(capture.garment, camera, pose)}
        pictures["open3d"] = draw(theirs, camera, pose)[0]
        where = seen & (look(ours.mesh, capture.occluder, camera, pose, 1e-3 * config.slack_mm).inside > CLEAR_PX)
        for method, drawn in pictures.items():
            found[method].append(likeness(photo, drawn, where))
        _write(np.hstack([photo, *pictures.values()]), folder / f"{Path(name).stem}.png")
    _write(ours.picture, folder / "texture.png")
    _write(theirs.picture, folder / "open3d.png")
    steps = {"texture": seam_steps(ours, sample), "open3d": seam_steps(theirs, sample)}
    return [as_row(method, each, seconds.get(method), steps.get(method, {})) for method, each in found.items()]


def as_row(
    method: str, each: Sequence[dict[str, float]], seconds: float | None, steps: dict[str, float]
) -> dict[str, Value]:
    """Return the means over photos, the worst of what has a bar, and which bars the means miss."""
    mean = {name: float(np.mean([one[name] for one in each])) for name in each[0]}
    worst = {f"{name}_worst": min(one[name] for one in each) for name in BARS}
    missed = [f"{name} {mean[name]:.3g} < {bar:g}" for name, bar in BARS.items() if mean[name] < bar]
    return {"method": method, "seconds": seconds, **mean, **worst, **steps, "missed": "; ".join(missed) or None}


def choose(cameras: CameraSet, which: NDArray[np.int64]) -> CameraSet:
    """Return some of the cameras."""
    return CameraSet(
        tuple(cameras.names[k] for k in which),
        tuple(cameras.intrinsics[k] for k in which),
        cameras.world_from_cam[which],
        cameras.metric,
    )


def _write(picture: ByteArray, path: Path) -> None:
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(path)


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
    """Read the command line, measure, and print a row for each run and method."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scan.look", description=__doc__)
    parser.add_argument("run", type=Path, nargs="+", help="runs of `vto scan` or of a document, from photos")
    parser.add_argument("--held-out", type=int, default=4, metavar="N", help="photos that are left out")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="settings of the texture")
    parser.add_argument(
        "--out", type=Path, default=Path("runs/looks"), metavar="DIR", help="for rows.jsonl, and pictures beside photos"
    )
    arguments = parser.parse_args()
    config = TextureConfig.model_validate(dict(pair.split("=", 1) for pair in arguments.set))
    table = LiveRows(arguments.out, _COLUMNS)
    for number, run in enumerate(arguments.run):
        folder = arguments.out / f"{number}_{run.name}"
        for row in measure_look(read_capture(run), arguments.held_out, config, folder):
            table.add({"run": str(run), **row})


if __name__ == "__main__":
    main()
