"""Execution of a bench: a journal that survives interruptions, the JSON document and the picture."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from vto_pipeline.bench.bench import Bench, Row, Watch
from vto_pipeline.bench.cloth.comparison import compare, level_as_json
from vto_pipeline.bench.machine import same_machine, this_machine
from vto_pipeline.bench.provenance import provenance
from vto_pipeline.bench.report_card.fronts import fronts
from vto_pipeline.bench.sources import sources_of
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.files import replacing


@dataclass(frozen=True)
class Files:
    """Where a bench writes.

    Args:
        document: All rows, written when the bench is complete.
        picture: The plot of it.
        journal: Machine and sources, and the rows so far, one a line, while it runs; gone when it is complete.
    """

    document: Path
    picture: Path
    journal: Path

    @classmethod
    def of(cls, name: str, folder: Path) -> Files:
        """Return the files of a bench in a folder."""
        return cls(folder / f"{name}.json", folder / f"{name}.png", folder / f"{name}.partial.jsonl")


def run_bench(
    name: str,
    bench: Bench,
    folder: Path,
    *,
    quick: bool = False,
    force: bool = False,
    peers: Sequence[Row] = (),
    say: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Measure what is not yet measured on this machine with these sources, and write document and picture.

    Args:
        name: Of the bench.
        bench: The bench.
        folder: Where its files are; made if need be.
        quick: Fewer and smaller points.
        force: Measure all again.
        peers: Rows measured elsewhere, to stand beside ours.
        say: Takes one line of progress.

    Returns:
        The document: {"bench", "command", "commit", "date", "machine", "sources", "quick", "rows", "fronts"}; with
        peers also "peers" and "levels", see `comparison`.
    """
    files = Files.of(name, folder)
    head = {"machine": this_machine(), "sources": sources_of([bench.module])}
    known = [] if force else known_rows(files, head)
    rows: dict[str, Row] = {}
    written = {row.key for row in known}
    with replacing(files.journal) as beside, beside.open("w", encoding="utf-8") as journal:
        _write_line(journal, head)
        for row in known:
            _write_line(journal, row.as_json())
    with files.journal.open("a", encoding="utf-8") as journal:
        for row in bench.rows(quick, Watch(say, known)):
            rows[row.key] = row
            if row.key not in written:
                _write_line(journal, row.as_json())
    measured = [row.as_json() for row in rows.values()]
    command = f"vto bench {name}{' --quick' if quick else ''}"
    document = {"bench": name, "quick": quick, **provenance(command), **head, "rows": measured}
    document["fronts"] = fronts(bench.module, rows.values(), quick)
    if peers:
        document["peers"] = [row.as_json() for row in peers]
        document["levels"] = [level_as_json(level) for level in compare(rows.values(), peers)]
    write_json(files.document, document)
    draw(bench, document, files.picture)
    files.journal.unlink()
    return document


def draw(bench: Bench, document: dict[str, Any], picture: Path) -> None:
    """Write the picture of a document."""
    with replacing(picture) as beside:
        beside.write_bytes(bench.draw(document))


def known_rows(files: Files, head: Mapping[str, Any]) -> list[Row]:
    """Return the rows of an earlier run, whole or interrupted, on the same machine with the same sources.

    Args:
        files: Where an earlier run has written.
        head: What such a run says of itself: "machine" and "sources".
    """
    found: dict[str, Row] = {}
    for before, rows in (_read_document(files.document), _read_journal(files.journal)):
        if before.get("sources") == head["sources"] and same_machine(before["machine"], head["machine"]):
            found.update((row.key, row) for row in (Row.from_json(plain) for plain in rows))
    return list(found.values())


def _read_document(path: Path) -> tuple[dict[str, Any], Iterable[dict[str, Any]]]:
    if not path.is_file():
        return {}, []
    document = json.loads(path.read_text(encoding="utf-8"))
    return document, document["rows"]


def _read_journal(path: Path) -> tuple[dict[str, Any], Iterable[dict[str, Any]]]:
    """Read as far as the last whole line: the process may have been killed while it wrote."""
    if not path.is_file():
        return {}, []
    lines: list[dict[str, Any]] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            lines.append(json.loads(line))
        except ValueError:
            break
    return (lines[0], lines[1:]) if lines else ({}, [])


def _write_line(stream: TextIO, value: dict[str, Any]) -> None:
    stream.write(json.dumps(value, allow_nan=False) + "\n")
    stream.flush()
