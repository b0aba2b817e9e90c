"""Common steps of run, scan, fit and drape: check the document, plan, run, print the outcome."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from vto_pipeline.cli.progress import show_progress
from vto_pipeline.cli.results import result_lines
from vto_pipeline.cli.session import Session
from vto_pipeline.errors import ComputationError, InputError
from vto_pipeline.io.documents import Document, load_yaml, read_json
from vto_pipeline.io.sniff import find_kind
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.folder import RECORD, existing_run
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.plan import Plan, make_plan
from vto_pipeline.pipeline.request import Request, read_request


def catalogue() -> Catalogue:
    """Return the project's tables."""
    from vto_pipeline.stages import CATALOGUE  # loads every domain: not for `vto --help`

    return CATALOGUE


def planned(path: Path, overrides: Sequence[str], tables: Catalogue) -> tuple[Request, Plan]:
    """Return the request and the plan of a document."""
    return planned_document(load_yaml(path), path.resolve().parent, overrides, tables)[:2]


def planned_document(
    document: Document, base: Path, overrides: Sequence[str], tables: Catalogue
) -> tuple[Request, Plan, Catalogue]:
    """Return the request, the plan and the tables of a loaded document, whose paths start from a folder."""
    document, tables = _for_its_garments(document, tables)
    request = read_request(document, base, tables, overrides)
    return request, make_plan(request, tables), tables


def _for_its_garments(document: Document, tables: Catalogue) -> tuple[Document, Catalogue]:
    """Return document and tables with a row for each garment, if there are several."""
    from vto_pipeline.stages.outfit import expand_document, garment_names, outfit_tables

    names = garment_names(document)
    return expand_document(document, names), outfit_tables(tables, names)


def run_tables(folder: Path, tables: Catalogue) -> Catalogue:
    """Return the tables that a run was made with.

    Raises:
        InputError: it is not the folder of a run.
    """
    from vto_pipeline.stages.outfit import names_in_run, outfit_tables

    return outfit_tables(tables, names_in_run(read_json(existing_run(folder) / RECORD)))


def captured_kind(path: Path, session: Session) -> str:
    """Return the kind of a capture, "photos", "video", "depth", "cloud" or "surface"; print why.

    Raises:
        InputError: it is none of these.
    """
    kind, reason = find_kind(path)
    if kind not in ("photos", "video", "depth", "cloud", "surface"):
        raise InputError(
            f"this looks like {kind} ({reason}); expected photos, a video, depth frames, a cloud or a mesh",
            where=str(path),
        )
    session.say(f"{path}: {kind}, because {reason}")
    return kind


def typed_document(command: str, given: Mapping[str, Any], want: Sequence[str], stages: Mapping[str, Any]) -> Document:
    """Return the document equivalent to a command line, without the inputs that were not given.

    Args:
        command: Stands where a file's name stands in messages.
        given: Section or "section.kind" -> value or None.
        want: Artifacts.
        stages: Settings by section.
    """
    sections: dict[str, Any] = {}
    for key, value in given.items():
        if value is not None:
            section, _, kind = key.partition(".")
            plain = str(value) if isinstance(value, Path) else value
            if kind:
                sections.setdefault(section, {})[kind] = plain
            else:
                sections[section] = plain
    data = {"schema": 1, "given": sections, "want": list(want), "stages": dict(stages)}
    return Document(data, Path(command))


def run_document(
    document: Document,
    base: Path,
    output: Path,
    overrides: Sequence[str],
    force_all: bool,
    session: Session,
    tables: Catalogue,
    cache: Path | None = None,
) -> None:
    """Run a document and print the outcome to stdout.

    Raises:
        VtoError: of whatever kind; a failed computation is recorded in run.json and its partial result named.
    """
    request, plan, tables = planned_document(document, base, overrides, tables)
    with show_progress(session) as listener:
        try:
            record = run(request, plan, tables, output, force_all=force_all, listener=listener, cache=cache)
        except ComputationError as error:
            if error.partial:
                error.hint = "; ".join(
                    filter(None, [error.hint, f"the partial result is in {output / 'out' / 'partial'}"])
                )
            raise
    session.answer({**record, "run": str(output)}, _outcome(record, output, tables))
    for line in result_lines(record["wanted"], output / "out", tables):
        session.say(line)


def _outcome(record: Mapping[str, Any], output: Path, tables: Catalogue) -> Iterator[str]:
    """Yield the outcome of a run as plain lines."""
    counts = dict.fromkeys(("ran", "cached", "left_out"), 0)
    for stage in record["stages"]:
        counts[stage["status"]] += 1
    yield (
        f"done in {record['seconds']:.1f} s; stages: {counts['ran']} ran, {counts['cached']} from the cache, "
        f"{counts['left_out']} left out"
    )
    width = max(len(artifact) for artifact in record["wanted"])
    for artifact in record["wanted"]:
        path = output / "out" / tables.kind(artifact).filename
        yield f"  {artifact:<{width}}  {path if path.is_file() else 'as given'}"
    warnings = [(stage["name"], text) for stage in record["stages"] for text in stage["warnings"]]
    for name, text in warnings:
        yield f"  warning from {name.replace('_', ' ')}: {text}"
