"""Archives: exact, deterministic, without pickles."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import read_arrays, write_arrays

ARRAYS = {
    "b": np.arange(6, dtype=np.int32).reshape(2, 3),
    "a": np.array([0.1, np.nan, -0.0]),
    "names": np.array(["é", "long name"]),
    "flag": np.bool_(True),
    "none": np.empty((0, 3)),
}


@pytest.mark.parametrize("compress", [False, True])
def test_arrays_come_back_exactly(tmp_path: Path, compress: bool) -> None:
    write_arrays(tmp_path / "a.npz", ARRAYS, compress=compress)
    back = read_arrays(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as independent:
        assert sorted(independent.files) == sorted(ARRAYS)
    for name, value in ARRAYS.items():
        assert back[name].dtype == np.asarray(value).dtype
        assert back[name].tobytes() == np.asarray(value).tobytes()


def test_bytes_depend_on_the_arrays_alone(tmp_path: Path) -> None:
    write_arrays(tmp_path / "a.npz", ARRAYS)
    write_arrays(tmp_path / "b.npz", dict(reversed(ARRAYS.items())))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_pickles_are_not_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "bad.npz", x=np.array([{"a": 1}], dtype=object))
    with pytest.raises(FormatError, match="not an archive of plain arrays"):
        read_arrays(tmp_path / "bad.npz")


def test_missing_names_and_cut_archives_are_refused(tmp_path: Path) -> None:
    write_arrays(tmp_path / "a.npz", ARRAYS)
    with pytest.raises(FormatError, match="arrays missing: z; found a, b"):
        read_arrays(tmp_path / "a.npz", required=("a", "z"))
    (tmp_path / "cut.npz").write_bytes((tmp_path / "a.npz").read_bytes()[:-40])
    with pytest.raises(FormatError, match="not an archive"):
        read_arrays(tmp_path / "cut.npz")


def test_a_header_that_promises_more_than_there_is_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    header = b"\x93NUMPY\x01\x00\x76\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (9, 10000000000000), }"
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", header.ljust(127) + b"\n" + bytes(80))
    with pytest.raises(FormatError, match="a.npy promises shape \\(9, 10000000000000\\) and has 208 bytes"):
        read_arrays(tmp_path / "a.npz")


def test_a_shape_changed_in_the_header_is_found_by_the_checksum_or_the_size(tmp_path: Path) -> None:
    write_arrays(tmp_path / "a.npz", {"x": np.arange(6.0).reshape(2, 3)})
    data = (tmp_path / "a.npz").read_bytes()
    for shape in (b"(1, 3)", b"(3, 2)", b"(2, 2)", b"(-2,3)"):
        (tmp_path / "b.npz").write_bytes(data.replace(b"(2, 3)", shape))
        with pytest.raises(FormatError, match="not an archive of plain arrays"):
            read_arrays(tmp_path / "b.npz")


@pytest.mark.parametrize("data", [b"", b"text", b"\x93NUMPY\x03\x00", b"\x93NUMPY\x01\x00\x05\x00{'a':"])
def test_what_is_no_array_is_refused_if_it_is_called_one(tmp_path: Path, data: bytes) -> None:
    write_arrays(tmp_path / "a.npz", ARRAYS)
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
        archive.writestr("readme.txt", data)
    assert set(read_arrays(tmp_path / "a.npz")) == set(ARRAYS)
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
        archive.writestr("x.npy", data)
    with pytest.raises(FormatError, match="not an archive of plain arrays"):
        read_arrays(tmp_path / "a.npz")


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_arrays(tmp_path / "a.npz", {"zeros": np.zeros(1_000_000)}, compress=True)
    size = (tmp_path / "a.npz").stat().st_size
    monkeypatch.setattr("vto_pipeline.io.arrays._LIMIT_BYTES", 10 * size)
    with pytest.raises(FormatError, match="unpacks to 8000128 bytes"):
        read_arrays(tmp_path / "a.npz")
