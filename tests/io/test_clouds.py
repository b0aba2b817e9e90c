"""Point clouds as Open3D and NumPy wrote them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from io_shapes import write_e57, write_las, write_pts
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import FormatError
from vto_pipeline.io.clouds import read_cloud, read_own_cloud
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud

COUNT = 200


def cloud() -> PointCloud:
    rng = np.random.default_rng(2)
    points = rng.random((COUNT, 3)) * (0.5, 1.7, 0.3)
    points[0], points[1] = (0, 0, 0), (0, 1.7, 0)
    normals = rng.normal(size=(COUNT, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return PointCloud(points, normals, rng.integers(0, 256, (COUNT, 3)).astype(np.uint8))


def write_with_open3d(path: Path, ascii_: bool, compressed: bool = False) -> None:
    import open3d as o3d

    truth = cloud()
    theirs = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(truth.points)))
    theirs.normals = o3d.utility.Vector3dVector(np.array(truth.normals))
    theirs.colors = o3d.utility.Vector3dVector(truth.colors / 255.0)
    o3d.io.write_point_cloud(str(path), theirs, write_ascii=ascii_, compressed=compressed)


@pytest.mark.parametrize(
    ("suffix", "ascii_", "compressed"),
    [
        (".pcd", False, False),
        (".pcd", True, False),
        (".pcd", False, True),
        (".ply", False, False),
        (".ply", True, False),
    ],
)
def test_clouds_of_open3d_are_read(tmp_path: Path, suffix: str, ascii_: bool, compressed: bool) -> None:
    path = tmp_path / f"a{suffix}"
    write_with_open3d(path, ascii_, compressed)
    truth, back = cloud(), read_cloud(path)
    assert back.normals is not None
    assert back.colors is not None
    assert_allclose(
        back.points, truth.points, rtol=0, atol=1e-5
    )  # m: single precision, or the decimals of Open3D's text
    assert_allclose(back.normals, truth.normals, rtol=0, atol=1e-5)  # the same
    assert_array_equal(back.colors, truth.colors)


def test_our_ply_comes_back_to_the_bit(tmp_path: Path) -> None:
    truth = cloud()
    write_ply(tmp_path / "a.ply", truth)
    back = read_own_cloud(tmp_path / "a.ply")
    for name in ("points", "normals", "colors"):
        assert getattr(back, name).tobytes() == getattr(truth, name).tobytes()


@pytest.mark.parametrize("delimiter", [" ", ",", ";", ", "])
def test_xyz_with_normals(tmp_path: Path, delimiter: str) -> None:
    truth = cloud()
    np.savetxt(tmp_path / "a.xyz", np.hstack([truth.points, truth.normals]), delimiter=delimiter, header="x y z")
    back = read_cloud(tmp_path / "a.xyz")
    assert_allclose(back.points, truth.points, rtol=0, atol=1e-15)  # savetxt writes 18 digits
    assert_allclose(back.normals, truth.normals, rtol=0, atol=1e-15)  # the same
    assert back.colors is None


def test_xyz_with_colours(tmp_path: Path) -> None:
    truth = cloud()
    np.savetxt(tmp_path / "a.txt", np.hstack([truth.points, truth.colors]), fmt="%.9g")
    back = read_cloud(tmp_path / "a.txt")
    assert_array_equal(back.colors, truth.colors)
    assert back.normals is None


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_with_colours(tmp_path: Path, suffix: str) -> None:
    truth = cloud()
    write_las(tmp_path / f"a{suffix}", truth.points, truth.colors)
    back = read_cloud(tmp_path / f"a{suffix}")
    assert_allclose(back.points, truth.points, rtol=0, atol=6e-5)  # m: half a step of the file's 0.1 mm
    assert_array_equal(back.colors, truth.colors)


def test_pts_of_several_scans(tmp_path: Path) -> None:
    truth = cloud()
    write_pts(tmp_path / "a.pts", truth.points, truth.colors)
    twice = (tmp_path / "a.pts").read_text() * 2
    (tmp_path / "b.pts").write_text(twice)
    back = read_cloud(tmp_path / "b.pts")
    assert_allclose(back.points, np.tile(truth.points, (2, 1)), rtol=0, atol=1e-8)  # m: nine decimals
    assert_array_equal(back.colors, np.tile(truth.colors, (2, 1)))


def test_e57_scans_lie_in_one_frame_in_metres(tmp_path: Path) -> None:
    """A scan of 4 m is no scan in decimetres: the format is metric."""
    truth = cloud()
    quarter = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    large = 4.0 * truth.points
    poses = [(np.eye(3), np.zeros(3)), (quarter, np.array([0.3, -0.2, 1.0]))]
    local = [(large - shift) @ turn for turn, shift in poses]
    write_e57(tmp_path / "a.e57", local, [truth.colors] * 2, poses)
    job = Job()
    back = read_cloud(tmp_path / "a.e57", job=job)
    assert_allclose(back.points, np.tile(large, (2, 1)), rtol=0, atol=1e-6)  # m: pye57 writes single precision
    assert_array_equal(back.colors, np.tile(truth.colors, (2, 1)))
    assert "a.e57: 2 scans" in job.notes


def test_unusable_normals_are_left_out_and_told(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.xyz", np.hstack([cloud().points, np.zeros((COUNT, 3))]))
    job = Job()
    assert read_cloud(tmp_path / "a.xyz", job=job).normals is None
    assert "a.xyz: ignored the normals, as some are zero or not finite" in job.notes


def test_points_without_a_reading_are_dropped_and_told(tmp_path: Path) -> None:
    write_with_open3d(tmp_path / "a.pcd", ascii_=True)
    lines = (tmp_path / "a.pcd").read_text().splitlines()
    lines[-1] = " ".join(["nan"] * 3 + lines[-1].split()[3:])
    (tmp_path / "a.pcd").write_text("\n".join(lines) + "\n")
    job = Job()
    assert len(read_cloud(tmp_path / "a.pcd", job=job).points) == COUNT - 1
    assert "a.pcd: dropped 1 points without a reading (NaN)" in job.notes


@pytest.mark.parametrize(
    ("name", "data", "problem"),
    [
        ("a.xyz", b"1 2 3\n4 5\n", "2 numbers in this line, 3 in the lines before"),
        ("b.xyz", b"1 2 3\n4 5,5 6\n", "'5,5' is not a number"),
        ("c.xyz", b"1 2\n3 4\n", "2 numbers in a line; expected 3, 6"),
        ("d.xyz", b"# nothing\n", "there are no points"),
        ("e.xyz", b"0 0 0\nnan 1 1\n", "vertex 1 is (nan, 1, 1)"),
        ("a.pcd", b"VERSION 0.7\n", "no DATA line"),
        (
            "b.pcd",
            b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2000000000\nDATA binary\nabc",
            "24000000000 bytes), 3",
        ),
        ("c.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 9\nDATA ascii\n1 2 3\n", "9 points promised, 1 lines"),
        ("d.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA zipped\n1", "DATA zipped is not supported"),
        (
            "g.pcd",
            b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 9\nDATA binary_compressed\n\x01\0\0\0\xff\0\0\0a",
            "108 bytes promised, 255 packed into 1, 9 bytes follow",
        ),
        (
            "h.pcd",
            b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_compressed\n\x02\0\0\0\x0c\0\0\0\xff\xff",
            "Open3D cannot read",
        ),
        ("i.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2,5 3\n", "'2,5' is not a number"),
        ("j.pcd", b"FIELDS x y w\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", "no x, y, z; found x, y, w"),
        ("e.pcd", b"FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", "differ in length"),
        ("f.pcd", b"FIELDS x y z\nSIZE 3 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", "cannot parse the header"),
        ("a.pts", b"2\n1 2 3\n", "2 points promised, 1 lines follow"),
        ("b.pts", b"1 2 3\n4 5 6\n", "begins with the number of its points"),
        ("d.pts", "²\n1 2 3\n4 5 6\n".encode(), "begins with the number of its points"),
        ("c.pts", b"1\n1 2 3 0 256 0 0\n", "a colour is not in 0 to 255"),
        ("a.las", b"LASF" + bytes(50), "no LASF at its begin"),
        ("b.las", b"LASF" + bytes(300), "LAS version 0.0"),
        ("a.e57", b"ASTM-E57" + bytes(2000), "pye57 cannot read it"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "there are no vertices"),
    ],
)
def test_a_broken_cloud_is_one_error_with_a_reason(tmp_path: Path, name: str, data: bytes, problem: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FormatError) as caught:
        read_cloud(tmp_path / name)
    assert problem in caught.value.problem
