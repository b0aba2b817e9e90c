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


@click.command("bench")
@click.argument("names", metavar="NAME...", nargs=-1, required=True)
@click.option(
    "--out",
    "folder",
    type=PATH,
    default=Path("runs/bench"),
    show_default=True,
    metavar="DIR",
    help="Folder for NAME.json and NAME.png.",
)
@click.option("--quick", is_flag=True, help="Run fewer and smaller cases; takes minutes.")
@click.option("--force", is_flag=True, help="Measure again, ignoring earlier results.")
@click.option(
    "--against", type=PATH, metavar="FILE.jsonl", help="Results of other programs on the same scenes (solvers only)."
)
@message_options
@pass_session
def bench_command(
    session: Session, names: tuple[str, ...], folder: Path, quick: bool, force: bool, against: Path | None
) -> None:
    """Measure error against run time and plot it.

    Rows already measured on this machine with this code are reused, even from an interrupted run.

    \b
    vto bench solvers --quick
    vto bench solvers integrators stability physics scaling --out figures/
    """
    from vto_pipeline.bench import BENCHES
    from vto_pipeline.bench.cloth.comparison import read_peers
    from vto_pipeline.bench.record import Files, run_bench
    from vto_pipeline.errors import ConfigError

    unknown = [name for name in names if name not in BENCHES]
    if unknown:
        raise ConfigError(f"no such bench: {', '.join(unknown)}", hint=f"one of {', '.join(BENCHES)}")
    if against is not None and "solvers" not in names:
        raise ConfigError("--against applies only to the bench solvers", hint="vto bench solvers --against FILE.jsonl")
    peers = {} if against is None else {"solvers": read_peers(against)}
    documents = []
    for name in dict.fromkeys(names):
        session.say(f"bench {name}: {BENCHES[name].about}")
        documents.append(
            run_bench(name, BENCHES[name], folder, quick=quick, force=force, peers=peers.get(name, ()), say=session.say)
        )
    files = [Files.of(document["bench"], folder) for document in documents]
    data = [{**document, "picture": str(one.picture)} for document, one in zip(documents, files, strict=True)]
    session.answer({"benches": data}, _lines(documents, files))


def _lines(documents: Sequence[Mapping[str, Any]], files: Sequence[Files]) -> Iterator[str]:
    """Return lines with the result files, and the run times at the errors of a peer."""
    from vto_pipeline.cli.tables import table_lines

    for document, one in zip(documents, files, strict=True):
        yield f"{one.document}, {one.picture}: {len(document['rows'])} rows"
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
