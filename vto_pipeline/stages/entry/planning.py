"""The tables, and the request and the plan of a document."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.documents import Document, load_yaml, read_json, suggest
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.folder import RECORD, existing_run
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
    document: Document, base: Path, overrides: Sequence[str], tables: Catalogue, until: str | None = None
) -> tuple[Request, Plan, Catalogue]:
    """Return the request, the plan and the tables of a loaded document, whose paths start from a folder.

    Args:
        document: As loaded.
        base: Folder that relative paths start from.
        overrides: "section.key=value", which win over the document.
        tables: The catalogue.
        until: Stage to stop after; None: all that is wanted is made.
    """
    document, tables = _for_its_garments(document, tables)
    request = read_request(document, base, tables, overrides)
    plan = make_plan(request, tables)
    if until is not None:
        request = _wanted_until(until, request, plan)
        plan = make_plan(request, tables)
    return request, plan, tables


def _wanted_until(stage: str, request: Request, plan: Plan) -> Request:
    """Return the request for what a stage makes, by the same ways, with the pages that need nothing."""
    taken = {step.stage.name: step.stage for step in plan.steps}
    if stage not in taken:
        reason = f"{stage} is left out: {plan.left_out[stage]}" if stage in plan.left_out else suggest(stage, taken)
        raise ConfigError(f"the document does not run {stage!r}", hint=reason)
    makers = {artifact: name for artifact, name in plan.makers.items() if artifact not in request.given}
    pages = [a for a in request.want if a in makers and (page := taken[makers[a]]).final and not page.needs]
    want = [a for a in taken[stage].makes if makers.get(a) == stage]
    return replace(request, want=tuple(dict.fromkeys([*want, *pages])), choose={**makers, **request.choose})


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
