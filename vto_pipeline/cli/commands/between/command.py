"""vto between"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.errors import ConfigError, InputError


@click.command("between")
@click.argument("small", metavar="SMALL", type=PATH)
@click.argument("large", metavar="LARGE", type=PATH)
@click.option(
    "--share", type=click.FloatRange(0, 1), default=0.5, show_default=True, help="0 for SMALL, 1 for LARGE, or between."
)
@click.option("-o", "--output", type=PATH, metavar="FILE", required=True, help="Pattern, or mesh as .ply.")
@message_options
@pass_session
def between_command(session: Session, small: Path, large: Path, share: float, output: Path) -> None:
    """Make the size between two: patterns of the same panels, or meshes of the same triangles.

    \b
    vto between tee_S.json tee_L.json -o tee_M.json
    vto between shirt_S.ply shirt_L.ply --share 0.4 -o shirt_M.ply
    """
    from vto_pipeline.io.sniff import find_kind
    from vto_pipeline.model.job import Job

    for path in (small, large):
        if output.resolve() == path.resolve():
            raise ConfigError("the output would overwrite an input", where=str(output))
    kinds = [find_kind(path)[0] for path in (small, large)]
    if kinds[0] != kinds[1] or kinds[0] not in _MAKERS:
        raise InputError(f"a {kinds[0]} and a {kinds[1]}; expected two patterns, or two meshes")
    job = Job()
    facts = _MAKERS[kinds[0]](small, large, share, output, job)
    lines = [", ".join(f"{key}: {value}" for key, value in facts.items()), *job.notes, f"written: {output}"]
    session.answer({"share": share, **facts, "notes": job.notes, "written": str(output)}, lines)


def _pattern(small: Path, large: Path, share: float, output: Path, job: Any) -> dict[str, Any]:
    from vto_pipeline.garment.sizes.between import pattern_between
    from vto_pipeline.io.patterns.read import read_pattern
    from vto_pipeline.io.patterns.write import write_pattern

    made = pattern_between(read_pattern(small, job=job), read_pattern(large, job=job), share)
    write_pattern(output, made)
    return {"kind": "pattern", "panels": len(made.panels)}


def _mesh(small: Path, large: Path, share: float, output: Path, job: Any) -> dict[str, Any]:
    from vto_pipeline.garment.sizes.between import mesh_between
    from vto_pipeline.io.meshes import read_mesh, write_ply

    if output.suffix.lower() != ".ply":
        raise ConfigError(f"meshes are written as .ply, not as {output.suffix or 'a file without suffix'}")
    made = mesh_between(read_mesh(small, job=job), read_mesh(large, job=job), share)
    write_ply(output, made)
    return {"kind": "mesh", "vertices": len(made.vertices)}


_MAKERS = {"pattern": _pattern, "surface": _mesh}
