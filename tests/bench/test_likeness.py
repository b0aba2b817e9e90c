"""Likeness of pictures against scikit-image and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.ndimage import gaussian_filter

from vto_pipeline.bench.scan.drawn import draw, draw_vertex_colors, sample
from vto_pipeline.bench.scan.likeness import fit_gains, likeness, seam_steps
from vto_pipeline.bench.scan.look import as_row
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.texture import TexturedMesh

RNG = np.random.default_rng(2)
PHOTO = np.clip(gaussian_filter(RNG.normal(128, 300, (60, 80, 3)), (1, 1, 0)), 0, 255).astype(np.uint8)
NOISY = np.clip(PHOTO + RNG.normal(0, 9, PHOTO.shape), 0, 255).astype(np.uint8)
EVERYWHERE = np.ones(PHOTO.shape[:2], bool)


def test_psnr_and_ssim_are_those_of_scikit_image() -> None:
    metrics = pytest.importorskip("skimage.metrics")
    found = likeness(PHOTO, NOISY, EVERYWHERE)
    assert_allclose(found["psnr_db"], metrics.peak_signal_noise_ratio(PHOTO, NOISY), rtol=1e-9)  # the same formula
    gray = [picture @ np.array([0.299, 0.587, 0.114]) for picture in (PHOTO, NOISY)]
    options = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 255, "full": True}
    whole = metrics.structural_similarity(*gray, **options)[1]
    assert_allclose(found["ssim"], whole[5:-5, 5:-5].mean(), rtol=0.01)  # ours leaves out another margin


def test_brightness_is_levelled_and_blur_is_less_sharp() -> None:
    gains = np.array([0.4, 0.5, 0.35])  # linear light, as a camera's exposure and white balance
    dark = camera_curve(gains * light_of(PHOTO))
    found = likeness(PHOTO, dark, EVERYWHERE)
    assert found["psnr_db"] < 18 < 42 < found["psnr_levelled_db"]
    assert_allclose(fit_gains(PHOTO.reshape(-1, 3), dark.reshape(-1, 3)), 1 / gains, rtol=0.01)  # rounding to bytes
    assert_allclose(found["exposure_ev"], 1.0, atol=0.01)  # half the light is one stop
    assert_allclose(found["white_balance_ev"], np.log2(0.5 / 0.35), atol=0.02)
    assert_allclose(found["sharpness"], 1.0, rtol=0.02)  # a darker picture is as sharp; rounding to bytes
    bright = camera_curve(3.0 * light_of(PHOTO))  # what is clipped is lost, and no fit brings it back
    assert found["psnr_levelled_db"] > 5 + likeness(PHOTO, bright, EVERYWHERE)["psnr_levelled_db"]
    over = camera_curve(2.5 * light_of(PHOTO)).reshape(-1, 3)  # the clipped part of a photo does not bias the fit
    assert_allclose(fit_gains(over, PHOTO.reshape(-1, 3)), 2.5, rtol=0.01)  # rounding to bytes
    shifted = np.roll(PHOTO, 3, axis=1)  # nor does it forgive a pattern in the wrong place
    assert (
        likeness(PHOTO, shifted, EVERYWHERE)["psnr_levelled_db"] < likeness(PHOTO, shifted, EVERYWHERE)["psnr_db"] + 4
    )
    blurred = gaussian_filter(PHOTO, (2, 2, 0))
    assert likeness(PHOTO, blurred, EVERYWHERE)["sharpness"] < 0.5


def light_of(picture: np.ndarray) -> np.ndarray:
    """Linear light of sRGB bytes: IEC 61966-2-1."""
    share = picture / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def camera_curve(light: np.ndarray) -> np.ndarray:
    """Bytes that a camera writes for linear light."""
    kept = np.clip(light, 0, 1)
    curve = np.where(kept <= 0.0031308, 12.92 * kept, 1.055 * np.maximum(kept, 1e-9) ** (1 / 2.4) - 0.055)
    return np.rint(255 * curve).astype(np.uint8)


def test_only_what_is_asked_for_is_compared() -> None:
    half = EVERYWHERE.copy()
    half[:, 40:] = False
    spoilt = PHOTO.copy()
    spoilt[:, 40:] = 0
    found = likeness(PHOTO, spoilt, half)
    assert found["psnr_db"] > 80
    assert found["wrong_share"] == 0
    assert found["compared_share"] == 0.5


def test_a_row_names_the_bars_that_are_missed() -> None:
    good, poor = ({"psnr_levelled_db": 27.0, "ssim": 0.86, "sharpness": share} for share in (0.9, 0.5))
    assert as_row("texture", [good], 1.0, {})["missed"] is None
    row = as_row("texture", [good, poor], 1.0, {})
    assert row["missed"] == "sharpness 0.7 < 0.8"
    assert row["sharpness_worst"] == 0.5


def square(gap: float) -> TexturedMesh:
    """A square of two triangles before the camera, with its picture upright; the second one's place moved."""
    points = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    place = 0.25 + 0.25 * (points[faces][..., :2] + 1)
    place[1, :, 0] += gap
    ramp = np.zeros((100, 100, 3), np.uint8)
    ramp[...] = np.rint(2.5 * np.arange(100) + 1.25)[None, :, None]
    return TexturedMesh(TriangleMesh(points, faces, texture=place), ramp, np.ones((100, 100), bool))


def test_a_step_at_a_seam_is_what_the_picture_has_there() -> None:
    assert seam_steps(square(0.0), sample) == {"seam_step_median": 0.0, "seam_step_p95": 0.0}
    found = seam_steps(square(0.1), sample)
    assert_allclose(found["seam_step_median"], 25.0, atol=0.1)  # a tenth of a ramp from 0 to 250; bytes


def test_a_square_is_drawn_where_the_camera_sees_it() -> None:
    camera = Intrinsics(40, 40, 40.0, 40.0, 19.5, 19.5)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])  # looks along -Z, picture upright
    pose[2, 3] = 4.0
    picture, seen = draw(square(0.0), camera, pose)
    assert seen[10:30, 10:30].all()
    assert seen.sum() == 400
    expected = 250 * (0.25 + 0.5 * (np.arange(20) + 0.5) / 20)
    assert_allclose(picture[15, 10:30, 0], expected, atol=2)  # half a texel, and bytes


def test_colors_of_vertices_are_drawn_as_perspective_has_it() -> None:
    """On a square tilted away, halfway in the picture is not halfway on the square."""
    points = np.array([[-1.0, -1, 1], [1, -1, -1], [1, 1, -1], [-1, 1, 1]])
    ramp = np.repeat(np.array([[0], [240], [240], [0]], np.uint8), 3, axis=1)
    mesh = TriangleMesh(points, np.array([[0, 1, 2], [0, 2, 3]]), ramp)
    camera = Intrinsics(40, 40, 40.0, 40.0, 19.5, 19.5)
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 4.0
    picture = draw_vertex_colors(mesh, camera, pose)
    slope = (np.arange(10, 26) - 19.5) / 40  # x / depth, where depth = 4 + x, so x = 4 slope / (1 - slope)
    expected = 120 * (1 + 4 * slope / (1 - slope))
    assert_allclose(picture[20, 10:26, 1], expected, atol=1.5)  # bytes, and samples within a pixel
    assert (picture[20, :6] == 0).all()
