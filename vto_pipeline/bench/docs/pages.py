"""Pages from templates: README.md and docs/, with every measured figure from a results file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from vto_pipeline.bench.docs.results import Quoted, Results
from vto_pipeline.errors import ConfigError, VtoError

SOURCES, RESULTS, FIGURES = "docs/source", "docs/results", "docs/benchmarks/figures.md"
"""Under the project's root: the templates, the results files, and the page that lists every figure."""
_FRONT = "README.md"
_NOTE = "<!-- Written by `make docs` from {source}: change that. -->\n"


def render_pages(root: Path) -> dict[str, str]:
    """Return every page that is made from a template.

    Args:
        root: The project's folder.

    Returns:
        Path under the root -> text, the list of figures among them.

    Raises:
        ConfigError: a template is wrong, or asks for a figure that no results file has.
    """
    pages: dict[str, str] = {}
    quoted: dict[str, list[Quoted]] = {}
    for source in sorted((root / SOURCES).rglob("*.md.j2")):
        results = Results(root / RESULTS)
        page = page_of(source.relative_to(root / SOURCES))
        pages[page] = _NOTE.format(source=source.relative_to(root).as_posix()) + _fill(source, results)
        quoted[page] = results.quoted
    pages[FIGURES] = "\n".join(_figure_lines(quoted)) + "\n"
    return pages


def page_of(template: Path) -> str:
    """Return where a template's page goes, under the project's root; both paths with slashes."""
    name = PurePosixPath(template.as_posix().removesuffix(".j2"))
    return str(name) if str(name) == _FRONT else str(PurePosixPath("docs") / name)


def _fill(source: Path, results: Results) -> str:
    import jinja2

    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, keep_trailing_newline=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.globals.update(
        names=results.names,
        figure=results.figure,
        rows=results.rows,
        source=results.source,
        fronts=results.fronts,
        no_fronts=results.no_fronts,
        day=lambda name: results.document(name)["date"],
        chosen=lambda text: text,
    )
    try:
        return environment.from_string(source.read_text(encoding="utf-8")).render()
    except jinja2.TemplateError as error:
        line = getattr(error, "lineno", None)
        raise ConfigError(f"template: {error}", where=f"{source}, line {line}" if line else str(source)) from None
    except VtoError as error:
        raise ConfigError(f"{error.problem} ({error.where})", where=str(source)) from None


def _figure_lines(quoted: Mapping[str, list[Quoted]]) -> Iterator[str]:
    yield f"<!-- Written by `make docs` from {SOURCES}. -->"
    yield "# Every figure, its command and its file"
    yield ""
    yield "Each row is a measured figure on a page. Its file has it in full, with machine, date and commit."
    yield "`vto bench --stale --out docs/results` lists the files that are older than the code that they measure."
    for page, figures in quoted.items():
        if not figures:
            continue
        link = os.path.relpath(page, Path(FIGURES).parent)
        yield from (
            "",
            f"## [{page}]({link})",
            "",
            "| figure | of | file | measured | command |",
            "|---|---|---|---|---|",
        )
        for one in dict.fromkeys(figures):
            name = f"[{one.source}]({os.path.relpath(f'{RESULTS}/{one.source}', Path(FIGURES).parent)})"
            yield f"| {one.text} | {one.what} | {name} | {one.version} | `{one.command}` |"
