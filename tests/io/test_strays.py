"""Size and place of what is read: stray points decide no unit, and map coordinates lose no digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from io_shapes import capsule
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import InputError
from vto_pipeline.io.clouds import read_cloud
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.job import Job

HEIGHT_M = 1.7
"""Of the capsule."""


def points(count: int = 2000) -> np.ndarray:
    """On a capsule that stands in metres."""
    import trimesh

    return np.asarray(trimesh.sample.sample_surface(capsule(), count, seed=1)[0])


@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("cm", 100.0)])
@pytest.mark.parametrize("strays", [1, 20])
def test_strays_decide_no_unit(tmp_path: Path, unit: str, scale: float, strays: int) -> None:
    body = points()
    far = 12.0 * np.random.default_rng(3).uniform(-1.0, 1.0, (strays, 3))
    np.savetxt(tmp_path / "a.xyz", scale * np.vstack([body, far]))
    job = Job()
    back = read_cloud(tmp_path / "a.xyz", job=job).points
    assert_allclose(back[: len(body)], body, rtol=1e-12, atol=1e-12)  # 18 digits, scaled there and back
    (warning,) = job.warnings
    assert "98 % of the points measure" in warning
    assert any(f"assumed to be {unit}" in note for note in job.notes)


def test_a_wide_floor_decides_no_unit(tmp_path: Path) -> None:
    import trimesh

    floor = trimesh.Trimesh([[-4, -0.9, -4], [4, -0.9, -4], [4, -0.9, 4], [-4, -0.9, 4]], [[0, 2, 1], [0, 3, 2]])
    trimesh.util.concatenate([capsule().subdivide(), floor]).export(tmp_path / "a.ply")
    job = Job()
    assert_allclose(np.ptp(read_mesh(tmp_path / "a.ply", job=job).vertices[:, 0]), 8.0, rtol=1e-6)  # single precision
    assert len(job.warnings) == 1


def test_a_room_that_has_no_unit_gets_none_without_its_far_corners(tmp_path: Path) -> None:
    """10 m, and a few points at 29 m, as laser scans have them through a window: neither is a garment in any unit."""
    room = np.random.default_rng(4).uniform(0.0, 10.0, (2000, 3))
    np.savetxt(tmp_path / "a.xyz", np.vstack([room, [[29.0, 0.0, 0.0]]]))
    with pytest.raises(InputError, match="the longest side is 29"):
        read_cloud(tmp_path / "a.xyz")


def test_a_stated_unit_holds_for_a_body_with_strays(tmp_path: Path) -> None:
    body = points()
    np.savetxt(tmp_path / "a.xyz", np.vstack([body, [[29.0, 0.0, 0.0]]]))
    assert_array_equal(read_cloud(tmp_path / "a.xyz", unit="m").points[: len(body)], body)


def test_what_has_no_strays_is_not_warned_of(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.xyz", points())
    job = Job()
    read_cloud(tmp_path / "a.xyz", job=job)
    assert not job.warnings


def test_map_coordinates_come_near_the_origin_alike(tmp_path: Path) -> None:
    place = np.array([512_300.0, 4_210_900.0, 118.0])
    body = points()
    np.savetxt(tmp_path / "a.xyz", body + place, fmt="%.6f")
    mesh = capsule()
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.vertices + place]
    faces = [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (tmp_path / "a.obj").write_text("\n".join(lines + faces) + "\n")
    job = Job()
    cloud, surface = read_cloud(tmp_path / "a.xyz", job=job).points, read_mesh(tmp_path / "a.obj").vertices
    left = np.array([300.0, -100.0, 118.0])
    assert_allclose(cloud, body + left, rtol=0, atol=2e-6)  # m: six decimals
    assert_allclose(surface, mesh.vertices + left, rtol=0, atol=2e-6)  # the same
    assert "a.xyz: moved by -512, -4211, 0 km (x, y, z), near the origin" in job.notes


def test_what_lies_near_stays_to_the_bit(tmp_path: Path) -> None:
    body = points() + np.array([400.0, 0.0, -120.0])
    np.savetxt(tmp_path / "a.xyz", body)
    assert_array_equal(read_cloud(tmp_path / "a.xyz").points, body)
