"""Rows of a bench in Markdown: each as it comes, and those before an error are kept."""

from __future__ import annotations

from collections.abc import Iterator

from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.errors import InputError


def rows(broken: bool) -> Iterator[tuple[str, ...]]:
    yield "a", "1"
    if broken:
        raise InputError("no such file")
    yield "b", "2"


def test_all_rows_are_printed(capsys):
    assert print_table(("name", "mm"), rows(broken=False)) == 0
    assert capsys.readouterr() == ("| name | mm |\n| --- | --- |\n| a | 1 |\n| b | 2 |\n", "")


def test_an_error_ends_the_table_with_its_code_and_loses_no_row(capsys):
    assert print_table(("name", "mm"), rows(broken=True)) == InputError("").exit_code == 3
    out, err = capsys.readouterr()
    assert out.endswith("| a | 1 |\n")
    assert "no such file" in err
