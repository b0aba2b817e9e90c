"""vto bench"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session

if TYPE_CHECKING:
    from vto_pipeline.bench.record import Files

_NAMED = 3
"""Changed files that a line names."""


@click.command("bench")
@click.argument("names", metavar="NAME...", nargs=-1)
@click.option(
    "--out",
    "folder",
    type=PATH,
    default=Path("runs/bench"),
    show_default=True,
    metavar="DIR",
    help="Folder for NAME.json and NAME.png.",
)
@click.option("--quick", is_flag=True, help="Run fewer and smaller cases; takes minutes a bench.")
@click.option("--force", is_flag=True, help="Measure again, ignoring earlier results.")
@click.option(
    "--against", type=PATH, metavar="FILE.jsonl", help="Results of other programs on the same scenes (solvers only)."
)
@click.option(
    "--compare", "earlier", type=PATH, metavar="OLD", help="Measure nothing: say what in DIR changed since folder OLD."
)
@click.option("--stale", is_flag=True, help="Measure nothing: say which results in DIR are older than their code.")
@message_options
@pass_session
def bench_command(
    session: Session,
    names: tuple[str, ...],
    folder: Path,
    quick: bool,
    force: bool,
    against: Path | None,
    earlier: Path | None,
    stale: bool,
) -> None:
    """Measure error against run time and plot it.

    Rows already measured on this machine are reused, even from an interrupted run, unless a file that the bench drives
    has changed. `all` stands for every bench, and for the sample documents in configs/, which are run as they stand and
    held against their truth.

    \b
    vto bench solvers --quick
    vto bench all --out docs/results
    vto bench --compare old/results --out docs/results
    vto bench --stale --out docs/results
    """
    from vto_pipeline.bench import BENCHES
    from vto_pipeline.bench.cloth.comparison import read_peers
    from vto_pipeline.bench.record import Files, run_bench
    from vto_pipeline.bench.sample_runs import SAMPLES, run_sample
    from vto_pipeline.errors import ConfigError, MissingDependencyError

    every = (*BENCHES, *SAMPLES)
    unknown = [name for name in names if name not in (*every, "all")]
    if unknown or not (names or earlier or stale):
        problem = f"no such bench: {', '.join(unknown)}" if unknown else "which bench?"
        raise ConfigError(problem, hint=f"all, or one of {', '.join(every)}")
    wanted = every if "all" in names else tuple(dict.fromkeys(names))
    if stale:
        _tell_stale(session, folder, wanted)
        return
    if earlier is not None:
        _tell_changes(session, earlier, folder, () if "all" in names else wanted)
        return
    if against is not None and "solvers" not in wanted:
        raise ConfigError("--against applies only to the bench solvers", hint="vto bench solvers --against FILE.jsonl")
    peers = {} if against is None else {"solvers": read_peers(against)}
    documents, files = [], []
    for name in wanted:
        if name in SAMPLES:
            session.say(f"sample document {name}")
            documents.append(run_sample(name, folder, force=force, say=session.say))
        else:
            session.say(f"bench {name}: {BENCHES[name].about}")
            options: dict[str, Any] = {"quick": quick, "force": force, "peers": peers.get(name, ()), "say": session.say}
            try:
                documents.append(run_bench(name, BENCHES[name], folder, **options))
            except MissingDependencyError as error:
                if name in names:
                    raise
                session.say(f"bench {name} is left out: {error.problem}")
                continue
        files.append(Files.of(name, folder))
    data = [
        {**document, "picture": str(one.picture) if one.picture.is_file() else None}
        for document, one in zip(documents, files, strict=True)
    ]
    session.answer({"benches": data}, _lines(documents, files))


def _tell_changes(session: Session, earlier: Path, folder: Path, names: tuple[str, ...]) -> None:
    """Print what got better or worse."""
    from dataclasses import asdict

    from vto_pipeline.bench.report_card.changes import compare_folders
    from vto_pipeline.cli.tables import table_lines

    found = compare_folders(earlier, folder, names)
    rows = [
        (change.verdict, change.bench, change.row, change.figure, _figure(change.old), _figure(change.new))
        for verdict in ("worse", "better", "other")
        for one in found
        for change in one.changes
        if change.verdict == verdict
    ]
    lines = []
    for one in found:
        rest = [one.untimed] if one.untimed else []
        rest += [f"{len(one.gone)} rows are gone"] if one.gone else []
        rest += [f"{one.added} rows are new"] if one.added else []
        lines.append(
            f"{one.bench}: {one.figures} errors and {one.times} times compared; {'; '.join(rest)}".rstrip("; ")
        )
    heads = ("", "bench", "row", "figure", "old", "new")
    session.answer(
        [asdict(one) for one in found], [*lines, *(table_lines(heads, rows) if rows else ["nothing changed"])]
    )


def _tell_stale(session: Session, folder: Path, names: tuple[str, ...]) -> None:
    """Print which results files are older than the code that they measure."""
    from vto_pipeline.bench.bench import least_seconds
    from vto_pipeline.bench.sources import changed_sources
    from vto_pipeline.cli.tables import table_lines
    from vto_pipeline.errors import InputError
    from vto_pipeline.io.documents import read_json

    found = names or sorted(path.stem for path in folder.glob("*.json"))
    if not found:
        raise InputError("no results files", where=str(folder), hint="vto bench --stale --out docs/results")
    data = []
    for name in found:
        document = read_json(folder / f"{name}.json")
        kept, changed = document.get("sources", {}), changed_sources(document)
        facts = {key: document.get(key) for key in ("command", "date", "commit")}
        taken = {"least_s": round(least_seconds(document["rows"]), 1)}
        data.append({"results": name, **facts, **taken, "sources": len(kept), "changed": changed})
    rows = [
        (one["results"], one["date"] or "", f"{one['least_s']:.0f}", _staleness(one, session.verbose)) for one in data
    ]
    session.answer(data, table_lines(("results", "measured", "at least s", "files it depends on"), rows))


def _staleness(one: Mapping[str, Any], verbose: bool) -> str:
    """Return whether results are of the code as it is, in words."""
    changed = one["changed"]
    if changed is None:
        return "not kept: measured by an earlier version"
    if not changed:
        return f"{one['sources']}, all as they were"
    shown = changed if verbose else changed[:_NAMED]
    rest = f" and {len(changed) - len(shown)} more (-v)" if len(changed) > len(shown) else ""
    return f"{len(changed)} of {one['sources']} changed: {', '.join(shown)}{rest}"


def _figure(value: float | str | bool | None) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _lines(documents: Sequence[Mapping[str, Any]], files: Sequence[Files]) -> Iterator[str]:
    """Return lines with the result files, and the run times at the errors of a peer."""
    from vto_pipeline.cli.tables import table_lines

    for document, one in zip(documents, files, strict=True):
        made = [one.document, one.picture] if one.picture.is_file() else [one.document]
        yield f"{', '.join(map(str, made))}: {len(document['rows'])} rows"
        if "levels" in document:
            heads = ("scene", "rms stretch", "peer", "s", "ours", "budget", "s", "ratio")
            yield from table_lines(heads, [_level_cells(level) for level in document["levels"]])


def _level_cells(level: Mapping[str, Any]) -> tuple[str, ...]:
    budget = " ".join(f"{name}={value:g}" for name, value in (level["settings"] or {}).items())
    own = (
        ("-", "", "", "")
        if level["seconds"] is None
        else (level["method"], budget, f"{level['seconds']:.3g}", f"{level['ratio']:.3f}")
    )
    return (level["scene"], f"{level['error']:.2g}", level["peer"], f"{level['peer_seconds']:.3g}", *own)
