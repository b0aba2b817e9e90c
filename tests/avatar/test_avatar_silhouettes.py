"""Two outlines: rendered in perspective from a body of known measures."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.from_silhouettes import SilhouettesConfig, fit_silhouettes
from vto_pipeline.avatar.measure import measure
from vto_pipeline.errors import AvatarError
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.job import Job

TRUTH = {"stature": 1.68, "chest_girth": 0.96, "waist_girth": 0.80, "hip_girth": 1.03}
SIZE, FOCAL, DISTANCE, CAMERA_HEIGHT = (480, 360), 480.0, 2.5, 1.0


def photograph(body: Avatar, yaw: float) -> np.ndarray:
    """Project every triangle with a pinhole; grey backdrop, brownish body, noise."""
    turn = trimesh.transformations.rotation_matrix(yaw, [0, 1, 0])[:3, :3]
    points = body.vertices @ turn.T
    depth = DISTANCE - points[:, 2]
    column = SIZE[1] / 2 + FOCAL * points[:, 0] / depth
    row = SIZE[0] / 2 - FOCAL * (points[:, 1] - CAMERA_HEIGHT) / depth
    corners = np.column_stack([column, row])[body.faces]
    rng = np.random.default_rng(2)
    shares = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6
    inside = np.einsum("sk,fkd->fsd", shares, corners).reshape(-1, 2)
    image = np.full((*SIZE, 3), 200.0)
    at = np.floor(inside).astype(int)
    image[at[:, 1], at[:, 0]] = (120, 90, 70)
    return np.clip(image + rng.normal(0, 4, image.shape), 0, 255).astype(np.uint8)


def test_intervals_hold_the_truth() -> None:
    body = fit_measurements(Measurements(TRUTH, sex="female"))
    job = Job()
    names = Silhouettes(Path("front.png"), Path("side.png"), TRUTH["stature"])
    config = SilhouettesConfig(sex="female", distance_m=DISTANCE, camera_height_m=CAMERA_HEIGHT)
    fitted = fit_silhouettes(names, photograph(body, 0.0), photograph(body, np.pi / 2), config, job)
    for name in ("chest_girth", "waist_girth", "hip_girth"):
        half = job.metrics[f"{name}_interval_mm"] * 1e-3
        assert 0.01 < half < 0.09, "as wide as the literature says, no wider"
        assert abs(job.metrics[f"{name}_m"] - TRUTH[name]) < half, name
        assert_allclose(measure(fitted).values[name], job.metrics[f"{name}_m"], rtol=0, atol=0.02)
    assert_allclose(measure(fitted).values["stature"], TRUTH["stature"], rtol=0, atol=1e-3)


def test_an_empty_backdrop_is_told() -> None:
    image = np.random.default_rng(0).normal(180, 3, (200, 150, 3)).clip(0, 255).astype(np.uint8)
    with pytest.raises(AvatarError, match="backdrop"):
        fit_silhouettes(Silhouettes(Path("f.png"), Path("s.png"), 1.7), image, image)
