"""Tables of batches as spreadsheets of other languages save them, and names as people have them."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from vto_pipeline.errors import ConfigError
from vto_pipeline.pipeline.batch.order import read_order

RUN = "schema: 1\nrun: {schema: 1, given: {left: {number: left.txt}}, want: [total]}\n"
CELLS = [["name", "given.right.number", "stages.add.offset"], ["Müller_1", "Köln/Jörg.txt", "1.5"], ["b", "", "-2"]]


def order(folder: Path, table: bytes) -> list:
    """The rows of a table, beside the files that it names."""
    (folder / "Köln").mkdir(exist_ok=True)
    for name in ("left.txt", "Köln/Jörg.txt"):
        (folder / name).write_text("3")
    (folder / "table.csv").write_bytes(table)
    (folder / "batch.yaml").write_text(f"{RUN}rows: table.csv\n")
    return read_order(folder / "batch.yaml")


def saved(separator: str, decimal: str = ".", quote: str = "", end: str = "\r\n") -> str:
    """The table as a spreadsheet writes it."""
    rows = [[f"{quote}{cell.replace('.5', f'{decimal}5')}{quote}" for cell in row] for row in CELLS]
    return end.join(separator.join(row) for row in rows) + end


@pytest.mark.parametrize(
    "table",
    [
        saved(",").encode("utf-8"),
        saved(";", decimal=",").encode("utf-8-sig"),  # Excel in German: CSV UTF-8
        saved("\t", decimal=",").encode("utf-16"),  # Excel: Unicode text
        saved(";", decimal=",", quote='"', end="\n").encode(),  # LibreOffice with all cells quoted
        saved(" ; ", decimal=",", end="\r").encode(),
    ],
    ids=["comma", "semicolon", "tab", "quoted", "spaced"],
)
def test_a_table_is_read_as_any_spreadsheet_saves_it(tmp_path: Path, table: bytes) -> None:
    first, second = order(tmp_path, table)
    assert (first.name, second.name) == ("Müller_1", "b")
    assert first.data["given"]["right"] == {"number": str((tmp_path / "Köln/Jörg.txt").resolve())}
    assert first.data["stages"] == {"add": {"offset": 1.5}}
    assert second.data["stages"] == {"add": {"offset": -2}}
    assert "right" not in second.data["given"]


def test_a_comma_parts_no_number_where_it_parts_cells(tmp_path: Path) -> None:
    (row,) = order(tmp_path, b'name,stages.add.offset\na,"1,5"\n')
    assert row.data["stages"]["add"]["offset"] == "1,5"  # which the settings refuse


def test_another_encoding_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="UTF-8") as refused:
        order(tmp_path, saved(";").encode("cp1252"))
    assert "CSV UTF-8" in refused.value.hint


def test_one_letter_written_as_two_is_the_same_name(tmp_path: Path) -> None:
    for form in ("NFC", "NFD"):
        (row,) = order(tmp_path, unicodedata.normalize(form, "name,seed\nMüller,1\n").encode())
        assert row.name == unicodedata.normalize("NFC", "Müller")


@pytest.mark.parametrize("name", ["a b", "-a", ".a", "ö/b", "衣" * 90])
def test_a_name_is_one_of_a_file_everywhere(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="not a valid name"):
        order(tmp_path, f"name,seed\n{name},1\n".encode())


@pytest.mark.parametrize(
    ("key", "values", "names"),
    [
        ("stages.add.offset", "[0.5, 0.25, -1]", ["a_0.5", "a_0.25", "a_-1"]),
        ("stages.add.offset", "[0.5, 1.25]", ["a_0.5", "a_1.25"]),  # distinct, and "0" would say something else
        ("given.right.number", "[Müller.txt, Möller.txt]", ["a_Müller", "a_Möller"]),
        ("given.right.number", "[s/17.txt, m/17.txt]", ["a_s_17.txt", "a_m_17.txt"]),
    ],
)
def test_combinations_have_names_that_differ(tmp_path: Path, key: str, values: str, names: list[str]) -> None:
    (tmp_path / "batch.yaml").write_text(f"{RUN}rows: [{{name: a}}]\nevery: {{{key}: {values}}}\n", encoding="utf-8")
    assert [row.name for row in read_order(tmp_path / "batch.yaml")] == names


def test_a_row_may_be_called_0(tmp_path: Path) -> None:
    (tmp_path / "batch.yaml").write_text(f"{RUN}rows: [{{name: 0}}, {{seed: 1}}]\n")
    assert [row.name for row in read_order(tmp_path / "batch.yaml")] == ["0", "row_2"]
