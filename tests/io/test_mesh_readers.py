"""Meshes come back as trimesh wrote them, in every format; ours come back to the bit."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from io_shapes import capsule, write_all_formats
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import InputError
from vto_pipeline.io.meshes import read_mesh, read_own_mesh, write_ply
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

SINGLE = {"rtol": 0, "atol": 1e-7}  # m: half a unit in the last place of single precision at 1 m
TEXT = {"rtol": 0, "atol": 6e-7}  # m: trimesh writes as few as six decimals


def sorted_triangles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Corner coordinates, each face turned so that its least corner leads, faces in order: independent of numbering."""
    corners = np.round(vertices[faces], 5)
    rows = [min(tuple(map(tuple, np.roll(face, -k, axis=0))) for k in range(3)) for face in corners]
    return np.array(sorted(rows))


@pytest.mark.parametrize("name", ["ply", "ply_ascii", "obj", "stl", "stl_ascii", "off", "glb"])
def test_every_format_gives_the_mesh_that_trimesh_wrote(tmp_path: Path, name: str) -> None:
    truth = capsule()
    mesh = read_mesh(write_all_formats(tmp_path)[name])
    assert mesh.vertices.shape == truth.vertices.shape
    assert mesh.faces.shape == truth.faces.shape
    ours, theirs = sorted_triangles(mesh.vertices, mesh.faces), sorted_triangles(truth.vertices, truth.faces)
    assert_allclose(ours, theirs, rtol=0, atol=2e-5)  # rounded to 1e-5 m above, to compare without numbering


@pytest.mark.parametrize(
    ("name", "close"), [("ply", SINGLE), ("ply_ascii", TEXT), ("obj", TEXT), ("off", TEXT), ("glb", SINGLE)]
)
def test_the_numbering_of_the_file_is_kept(tmp_path: Path, name: str, close: dict[str, float]) -> None:
    truth = capsule()
    mesh = read_mesh(write_all_formats(tmp_path)[name])
    assert_array_equal(mesh.faces, truth.faces)
    assert_allclose(mesh.vertices, truth.vertices, **close)


@pytest.mark.parametrize("name", ["ply", "ply_ascii", "obj"])
def test_vertex_colours_are_kept(tmp_path: Path, name: str) -> None:
    mesh = read_mesh(write_all_formats(tmp_path)[name])
    assert mesh.colors is not None
    difference = mesh.colors.astype(int) - capsule().visual.vertex_colors[:, :3]
    assert abs(difference).max() <= (1 if name == "obj" else 0)  # OBJ holds colours as decimals


def test_ply_round_trip_to_the_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    colors = rng.integers(0, 256, (50, 3)).astype(np.uint8)
    mesh = TriangleMesh(rng.normal(size=(50, 3)), rng.integers(0, 50, (80, 3)), colors)
    write_ply(tmp_path / "a.ply", mesh)
    back = read_own_mesh(tmp_path / "a.ply")
    assert back.vertices.tobytes() == mesh.vertices.tobytes()
    assert back.faces.tobytes() == mesh.faces.tobytes()
    assert back.colors is not None
    assert back.colors.tobytes() == colors.tobytes()
    import trimesh

    independent = trimesh.load(tmp_path / "a.ply", process=False)
    assert_array_equal(independent.faces, mesh.faces)
    assert_array_equal(np.asarray(independent.vertices), mesh.vertices)


@pytest.mark.parametrize("big_endian", [False, True])
def test_ply_with_mixed_polygons_and_other_properties(tmp_path: Path, big_endian: bool) -> None:
    order = ">" if big_endian else "<"
    header = (
        f"ply\nformat binary_{'big' if big_endian else 'little'}_endian 1.0\ncomment made by hand\n"
        "element vertex 5\nproperty float x\nproperty uchar quality\nproperty float y\nproperty float z\n"
        "element face 4\nproperty uchar flags\nproperty list uchar uint vertex_index\n"
        "property list uchar float texcoord\n"
        "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n"
    )
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 1.7, 0]])
    body = b"".join(np.array([(x, 7, y, z)], f"{order}f4,u1,{order}f4,{order}f4").tobytes() for x, y, z in points)
    for polygon in ([0, 1, 2, 3], [3, 2, 4], [0, 1, 2], [4, 2, 1, 0, 3]):
        body += bytes([1, len(polygon)]) + np.array(polygon, f"{order}u4").tobytes()
        body += bytes([2]) + np.array([0.5, 0.25], f"{order}f4").tobytes()
    body += np.array([0, 1], f"{order}i4").tobytes()
    path = tmp_path / "mixed.ply"
    path.write_bytes(header.encode() + body)
    job = Job()
    mesh = read_mesh(path, job=job)
    expected = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [0, 1, 2], [4, 2, 1], [4, 1, 0], [4, 0, 3]]
    assert mesh.faces.tolist() == expected
    assert_allclose(mesh.vertices, points, **SINGLE)
    assert "mixed.ply: split 2 polygons with more than 3 corners into triangles" in job.notes


def test_obj_with_quads_negative_numbers_continued_lines_and_textures(tmp_path: Path) -> None:
    path = tmp_path / "odd.obj"
    path.write_text(
        "# made by hand\nmtllib ../../secret.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1.5 0 \\\n\nv 0 1.5 0\nvt 0 0\nvn 0 0 1\n"
        "usemtl m\nf 1/1/1 2/1/1 3//1 4/1\ns off\nf -4 -3 -2\nv 0 0 1\nf 1 2 5\n"
    )
    mesh = read_mesh(path)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 4], [0, 1, 2], [0, 2, 3]]  # triangles before the quad
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1.5, 0], [0, 1.5, 0], [0, 0, 1]]


def test_obj_keywords_of_a_simulator_are_skipped_and_told(tmp_path: Path) -> None:
    """ARCSim writes material coordinates, velocities and labels of its own beside the mesh."""
    path = tmp_path / "sim.obj"
    path.write_text("v 0 0 0\nny 0 0 0\nnv 0 0 0\nv 1 0 0\nny 1 0 0\nv 0 1.5 0\nvv 0\nf 1 2 3\nt 0 1\n")
    job = Job()
    mesh = read_mesh(path, unit="m", job=job)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1.5, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert job.notes == ["sim.obj: skipped 5 lines whose keywords OBJ does not define: 'nv', 'ny', 't', 'vv'"]


def test_off_with_polygons_colours_and_comments(tmp_path: Path) -> None:
    path = tmp_path / "a.off"
    path.write_text(
        "COFF # by hand\n5 3 0 # counts\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255\n\n1 1 0 0 0 0 0\n0 1 0 0 0 0 0\n"
        "0.5 1.7 0 0 0 0 0\n4 0 1 2 3 9 9 9\n3 3 2 4\n5 4 3 0 1 2 0.5 0.5 0.5\n"
    )
    job = Job()
    mesh = read_mesh(path, unit="m", job=job)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 1.7, 0]]
    corners = [tuple(np.roll(face, -int(np.argmin(face)))) for face in mesh.faces]
    assert sorted(corners) == [(0, 1, 2), (0, 1, 4), (0, 2, 3), (0, 4, 3), (1, 2, 4), (2, 4, 3)]
    assert "a.off: split 2 polygons with more than 3 corners into triangles" in job.notes


def test_stl_solids_of_any_name_are_one_mesh(tmp_path: Path) -> None:
    facet = "  facet normal 0 0 1\n outer loop\n{}\n endloop\n endfacet\n"
    one = facet.format("vertex 0 0 0\nvertex 1 0 0\nvertex 0 1.5E0 0")
    other = facet.format("\tVERTEX 0 0 0\r\nvertex 0 1.5 0\nvertex -1 0 0")
    path = tmp_path / "a.stl"
    path.write_text(
        f"solid vertex facet group\n{one}endsolid vertex facet group\nsolid Solid 2\n{other}endsolid Solid 2\n"
    )
    mesh = read_mesh(path, unit="m")
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1.5, 0], [-1, 0, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_every_change_is_told(tmp_path: Path) -> None:
    path = tmp_path / "untidy.obj"
    path.write_text("v 0 0 0\nv 9 9 9\nv 1 0 0\nv 1 1.5 0\nf 1 3 4\nf 1 3 3\n")
    job = Job()
    mesh = read_mesh(path, unit="m", job=job)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1.5, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert job.notes == [
        "untidy.obj: dropped 1 faces that use a vertex twice",
        "untidy.obj: dropped 1 vertices that no face uses",
    ]
    assert job.warnings == ["untidy.obj: 1 vertices belong to no face: is the file truncated?"]


@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("dm", 10.0), ("cm", 100.0), ("mm", 1000.0)])
def test_the_unit_is_guessed_and_told(tmp_path: Path, unit: str, scale: float) -> None:
    mesh = capsule()
    mesh.apply_scale(scale)
    mesh.export(tmp_path / "a.ply")
    job = Job()
    height = np.ptp(read_mesh(tmp_path / "a.ply", job=job).vertices, axis=0).max()
    assert_allclose(height, 1.7, rtol=1e-6)  # the capsule's length, in single precision
    (note,) = job.notes
    assert f"unit: assumed to be {unit} (longest side {1.7 * scale:.4g})" in note
    assert ("set unit: m to override" in note) == (unit != "m")


def test_an_ambiguous_size_asks_for_the_unit_and_the_user_decides(tmp_path: Path) -> None:
    mesh = capsule()
    mesh.apply_scale(2.75 / 1.7)
    mesh.export(tmp_path / "a.ply")
    with pytest.raises(InputError, match="the longest side is 2.75") as caught:
        read_mesh(tmp_path / "a.ply")
    assert caught.value.hint == "give the unit; in a document: {file: a.ply, unit: cm}"
    assert_allclose(np.ptp(read_mesh(tmp_path / "a.ply", unit="m").vertices, axis=0).max(), 2.75, rtol=1e-6)  # single


def test_a_wrong_unit_is_refused_with_the_right_one(tmp_path: Path) -> None:
    mesh = capsule()
    mesh.apply_scale(100.0)
    mesh.export(tmp_path / "a.ply")
    with pytest.raises(InputError, match="with unit m the longest side is 170 m; expected 0.05 to 10.0 m") as caught:
        read_mesh(tmp_path / "a.ply", unit="m")
    assert caught.value.hint == "unit: cm would make it 1.7 m"
    with pytest.raises(InputError, match="unit is 'furlong'; expected one of m, dm, cm, mm, in, ft"):
        read_mesh(tmp_path / "a.ply", unit="furlong")


def test_a_body_of_13_thousand_vertices_is_read_in_good_time(tmp_path: Path) -> None:
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=5, radius=0.8)
    assert 10_000 < len(mesh.vertices) < 14_000
    mesh.export(tmp_path / "body.ply")
    read_mesh(tmp_path / "body.ply")
    start = sum(os.times()[:4])
    read_mesh(tmp_path / "body.ply")
    assert 0.02 < sum(os.times()[:4]) - start < 1.5  # s of CPU time, the child process included; 0.2 s measured


def test_a_surface_that_is_inside_out_is_turned_over_and_told(tmp_path: Path) -> None:
    truth = capsule()
    for faces, told in ((truth.faces, False), (truth.faces[:, ::-1], True)):
        write_ply(tmp_path / "body.ply", TriangleMesh(truth.vertices, faces))
        job = Job()
        mesh = read_mesh(tmp_path / "body.ply", job=job)
        assert_array_equal(mesh.faces, truth.faces)
        assert any("inside out" in note for note in job.notes) == told


def test_a_large_floor_turns_nothing_over(tmp_path: Path) -> None:
    """Beneath a scan it has so much flux that the sum over all axes is negative."""
    truth = capsule()
    low = truth.vertices[:, 1].min()
    sheet = np.array([[-2.0, low, -2], [2, low, -2], [2, low, 2], [-2, low, 2]])
    faces = np.vstack([truth.faces, np.array([[0, 2, 1], [0, 3, 2]]) + len(truth.vertices)])
    write_ply(tmp_path / "scan.ply", TriangleMesh(np.vstack([truth.vertices, sheet]), faces))
    assert_array_equal(read_mesh(tmp_path / "scan.ply", unit="m").faces, faces)
