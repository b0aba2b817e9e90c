"""Files that well-known readers crash on, or take for something shorter: each is one error with a reason."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from io_shapes import write_all_formats

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.meshes import read_mesh


@pytest.fixture(autouse=True)
def parse_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parse in this process: an interpreter per case costs time, and the border has tests of its own."""
    monkeypatch.setattr("vto_pipeline.io.meshes.run_limited", lambda parse, name, **_: dict(parse(name)))


PLY = (
    "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
)
POINTS = "0 0 0\n1 0 0\n0 1.5 0\n0 0 0.5\n"


def ascii_ply(faces: str = "3 0 1 2\n3 0 1 3\n", points: str = POINTS, vertices: int = 4, count: int = 2) -> bytes:
    return (PLY.format(vertices=vertices, faces=count) + points + faces).encode()


def binary_ply(indices: list[int], vertices: int = 4) -> bytes:
    header = PLY.format(vertices=vertices, faces=1).replace("ascii", "binary_little_endian")
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1.5, 0], [0, 0, 0.5]], "<f4").tobytes()
    return header.encode() + points + bytes([3]) + np.array(indices, "<i4").tobytes()


OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1.5 0\n"
STL_FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1.5 0\nendloop\nendfacet\n"

CASES = {
    "index_out_of_range.ply": (ascii_ply("3 0 1 2\n3 0 1 4000000\n"), "face 1 has the vertices 0, 1, 4000000"),
    "index_out_of_range_binary.ply": (
        binary_ply([0, 1, 4]),
        "face 0 has the vertices 0, 1, 4; there are vertices 0 to 3",
    ),
    "index_negative.ply": (ascii_ply("3 0 1 2\n3 0 1 -1\n"), "face 1 has the vertices 0, 1, -1"),
    "index_negative_binary.ply": (binary_ply([0, 1, -1]), "face 0 has the vertices 0, 1, -1"),
    "index_fraction.ply": (ascii_ply("3 0 1 2\n3 0 1 2.5\n"), "vertex index 2.5 is not a whole number"),
    "nan.ply": (ascii_ply(points="0 0 0\n1 nan 0\n0 1.5 0\n0 0 0.5\n"), "vertex 1 is (1, nan, 0)"),
    "infinite.ply": (ascii_ply(points="0 0 0\n1 0 0\n0 inf 0\n0 0 0.5\n"), "vertex 2 is (0, inf, 0)"),
    "claims_two_thousand_million.ply": (
        ascii_ply(vertices=2_000_000_000),
        "at least 2000000002 lines, but only 6 follow",
    ),
    "claims_binary.ply": (
        binary_ply([0, 1, 2], vertices=2_000_000_000),
        "at least 24000000001 bytes, but only 61 follow",
    ),
    "list_claims.ply": (binary_ply([0, 1, 2])[:-13] + bytes([255]) + bytes(12), "a list claims 255 entries"),
    "decimal_comma.ply": (ascii_ply(points=POINTS.replace("1.5", "1,5")), "'1,5' is not a number"),
    "points_only.ply": (ascii_ply("", count=0), "4 points and no faces; expected a mesh"),
    "not_a_ply.ply": (b"hello", "not a PLY file"),
    "more_than_promised.ply": (ascii_ply(count=1), "left over after the last element"),
    "header_without_end.ply": (b"ply\nformat ascii 1.0\nelement vertex 4\n", "no 'ply ... end_header'"),
    "header_unknown.ply": (ascii_ply().replace(b"property float x", b"property quad x"), "'property quad x'"),
    "index_out_of_range.obj": (OBJ + b"f 1 2 4\n", "face 0 has the vertices 0, 1, 3"),
    "index_zero.obj": (OBJ + b"f 0 1 2\n", "counted from 1"),
    "corner_without_vertex.obj": (OBJ + b"f 1/1 2/1 /1 3/1\n", "'/1' is not a number"),
    "index_back_too_far.obj": (OBJ + b"f -1 -2 -4\n", "counted from 1"),
    "nan.obj": (OBJ.replace(b"1.5", b"nan") + b"f 1 2 3\n", "vertex 2 is (0, nan, 0)"),
    "cut_in_a_face.obj": (OBJ + b"f 1 2 3\nf 1 2", "a face with 2 corners"),
    "cut_in_a_vertex.obj": (OBJ + b"v 1 2\nf 1 2 3\n", "2 numbers in this line, 3 in the lines before"),
    "cut_in_a_keyword.obj": (OBJ + b"f 1 2 3\nuse", "'use' is not an OBJ keyword"),
    "decimal_comma.obj": (OBJ.replace(b"1.5", b"1,5") + b"f 1 2 3\n", "'1,5' is not a number"),
    "no_faces.obj": (OBJ, "3 vertices and 0 faces"),
    "bytes.obj": (b"v 0 0 0\n\0\0\0", "not a text file"),
    "cut.stl": (
        b"solid a\n" + STL_FACET.encode() + b"facet normal 0 0 1\nouter loop\n",
        "2 facets, 3 corners, 0 endsolid",
    ),
    "cut_between_facets.stl": (b"solid a\n" + STL_FACET.encode(), "1 facets, 3 corners, 0 endsolid"),
    "count.stl": (bytes(80) + np.uint32(2_000_000_000).tobytes() + bytes(50), "take 100000000084"),
    "empty_solid.stl": (b"solid nothing\nendsolid nothing\n", "0 facets"),
    "decimal_comma.stl": (
        b"solid a\n" + STL_FACET.replace("1.5", "1,5").encode() + b"endsolid\n",
        "'1,5' is not a number",
    ),
    "corner_short_of_a_number.stl": (
        b"solid a\n" + STL_FACET.replace("1 0 0", "1 0").encode() + b"endsolid\n",
        "2 numbers in this line, 3 in the lines before",
    ),
    "decimal_comma.off": (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1,5 0\n3 0 1 2\n", "'1,5' is not a number"),
    "index_out_of_range.off": (b"OFF\n4 1 0\n" + POINTS.encode() + b"3 0 1 4\n", "face 0 has the vertices 0, 1, 4"),
    "index_fraction.off": (
        b"OFF\n4 1 0\n" + POINTS.encode() + b"3 0 1 2.5\n",
        "vertex index 2.5 is not a whole number",
    ),
    "counts.off": (
        b"OFF\n4 9 0\n" + POINTS.encode() + b"3 0 1 2\n",
        "promises 4 vertices and 9 faces, but 5 lines follow",
    ),
    "cut_in_a_face.off": (b"OFF\n4 2 0\n" + POINTS.encode() + b"3 0 1 2\n3 0", "has fewer indices"),
    "no_magic.off": (b"4 1 0\n" + POINTS.encode() + b"3 0 1 2\n", "does not begin with OFF"),
    "zero_area.ply": (ascii_ply("3 0 0 1\n3 1 1 2\n"), "mesh has no faces"),
}


@pytest.mark.parametrize("name", CASES)
def test_a_broken_file_is_one_error_with_a_reason(tmp_path: Path, name: str) -> None:
    data, problem = CASES[name]
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(FormatError) as caught:
        read_mesh(path)
    assert problem in caught.value.problem
    assert str(path) in caught.value.where
    assert caught.value.exit_code == 3


def test_the_sound_file_the_cases_are_made_from_is_read(tmp_path: Path) -> None:
    for name, data in (("a.ply", ascii_ply()), ("b.ply", binary_ply([0, 1, 2])), ("c.obj", OBJ + b"f 1 2 3\n")):
        (tmp_path / name).write_bytes(data)
        assert len(read_mesh(tmp_path / name).faces) in (1, 2)


@pytest.mark.parametrize("name", ["ply", "ply_ascii", "stl", "stl_ascii", "off", "glb"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 0.99])
def test_a_truncated_file_is_an_error_and_never_a_shorter_mesh(tmp_path: Path, name: str, share: float) -> None:
    path = write_all_formats(tmp_path)[name]
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(FormatError):
        read_mesh(path)


@pytest.mark.parametrize(
    ("name", "data", "problem", "hint"),
    [
        ("empty.obj", b"", "the file is empty (0 bytes)", ""),
        (
            "body.fbx",
            b"Kaydara",
            "files of type .fbx are not supported; expected .glb, .gltf, .npz, .obj, .off, .ply, .stl",
            "",
        ),
    ],
)
def test_what_is_no_mesh_file_is_refused_unopened(
    tmp_path: Path, name: str, data: bytes, problem: str, hint: str
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_mesh(tmp_path / name)
    assert (caught.value.problem, caught.value.hint) == (problem, hint)


def test_a_zip_is_not_opened_whatever_its_name(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("mesh.obj", OBJ + b"f 1 2 3\n")
    with pytest.raises(InputError, match="files of type .zip are not supported"):
        read_mesh(tmp_path / "a.zip")
    (tmp_path / "a.zip").rename(tmp_path / "a.obj")
    with pytest.raises(FormatError, match="not a text file"):
        read_mesh(tmp_path / "a.obj")


def test_a_missing_file_is_named_with_its_neighbour(tmp_path: Path) -> None:
    (tmp_path / "form.ply").write_bytes(ascii_ply())
    with pytest.raises(InputError) as caught:
        read_mesh(tmp_path / "from.ply")
    assert (caught.value.problem, caught.value.hint) == ("no such file", "did you mean form.ply?")


def test_a_file_beyond_the_size_limit_is_refused_unopened(tmp_path: Path) -> None:
    with (tmp_path / "huge.ply").open("wb") as stream:
        stream.truncate(1_000_000_001)  # a hole, no bytes on the disk
    with pytest.raises(InputError, match="has 1000000001 bytes; the limit is 1000000000"):
        read_mesh(tmp_path / "huge.ply")
