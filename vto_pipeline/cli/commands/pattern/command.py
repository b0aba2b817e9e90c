"""vto pattern"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.units import LENGTH_M

if TYPE_CHECKING:
    from vto_pipeline.garment.unsewn.unsew import Unsewn
    from vto_pipeline.model.job import Job
    from vto_pipeline.model.pattern import Pattern


@click.command("pattern")
@click.argument("paths", metavar="PATH...", type=PATH, nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    "outputs",
    type=PATH,
    multiple=True,
    metavar="PATH",
    help="Write a .dxf, .svg or .json, of a garment mesh an .obj as well; repeat for more; with --sizes, a folder.",
)
@click.option("--size", metavar="NAME", help="Take the panels of one size. [default: all]")
@click.option("--type", "kind", metavar="TYPE", help="Type of garment, or a file of size rules. [default: by name]")
@click.option("--sizes", metavar="S,M,L", help="Grade to these sizes, by the rules of the type.")
@click.option("--base", default="M", show_default=True, metavar="SIZE", help="The size that others are graded from.")
@click.option("--format", "form", type=click.Choice(("json", "dxf", "svg")), default="json", help="Of graded sizes.")
@click.option("--unit", type=click.Choice(sorted(LENGTH_M)), help="Unit of length, in place of the file's.")
@click.option("--plan", type=PATH, metavar="FILE", help="Where panels stand and what is sewn to what.")
@click.option("--allowance", type=float, metavar="MM", help="Add cut lines so far outside, notches, and grain lines.")
@click.option(
    "--seams",
    default="auto",
    show_default=True,
    metavar="WHERE",
    help="Where a garment mesh comes apart: auto, charts (of its texture), or a file of lines.",
)
@click.option(
    "--fabric", default="cotton_poplin", show_default=True, metavar="NAME|FILE", help="Of a garment mesh laid flat."
)
@message_options
@pass_session
def pattern_command(
    session: Session,
    paths: tuple[Path, ...],
    outputs: tuple[Path, ...],
    size: str | None,
    kind: str | None,
    sizes: str | None,
    base: str,
    form: str,
    unit: str | None,
    plan: Path | None,
    allowance: float | None,
    seams: str,
    fabric: str,
) -> None:
    """Measure a sewing pattern, and write it in another format or in other sizes; or make one of a garment mesh.

    Reads DXF after AAMA and ASTM D6673, SVG, and JSON of GarmentCode. Several files, or a folder, give a table with a
    row for each. A mesh is cut along its seams and laid flat.

    \b
    vto pattern tee.json
    vto pattern P1043.dxf --type trousers
    vto pattern shirt.dxf --size M -o shirt_M.svg
    vto pattern tee.svg --plan sewing.yaml -o tee.json
    vto pattern tee.json --allowance 10 -o tee.dxf
    vto pattern tee.json --sizes S,M,L,XL --base M -o tee_sizes/ --format dxf
    vto pattern patterns/
    vto pattern scanned_tee.ply --seams seams.yaml -o tee.json -o tee.svg
    """
    from vto_pipeline.cli.commands.pattern.unsewn import take_apart
    from vto_pipeline.io.meshes import PARSERS as MESHES
    from vto_pipeline.io.patterns.read import read_pattern
    from vto_pipeline.model.job import Job

    files = _files(paths)
    if allowance is not None and (sizes is not None or len(files) != 1):
        raise ConfigError("--allowance takes one pattern, and does not go with --sizes", hint="grade what it writes")
    if plan is not None and (sizes is not None or len(files) != 1):
        raise ConfigError("--plan takes one pattern, and does not go with --sizes")
    if sizes is not None:
        if len(files) != 1 or size is not None:
            raise ConfigError("--sizes takes one pattern, and does not go with --size")
        if len(outputs) > 1:
            raise ConfigError("--sizes writes one folder; more than one --output is given")
        output = outputs[0] if outputs else None
        _grade(session, files[0], kind, [one.strip() for one in sizes.split(",")], base, form, output, unit)
        return
    if len(paths) == 1 and not paths[0].is_dir():
        job = Job()
        if files[0].suffix.lower() in MESHES:
            if size is not None or plan is not None:
                raise ConfigError("--size and --plan go with patterns, and a mesh is given")
            taken = take_apart(files[0], seams, fabric, unit, job)
            _describe(session, files[0], _finished(taken.pattern, allowance), outputs, kind, job, taken)
        else:
            pattern = _sized(read_pattern(files[0], unit=unit, job=job), size)
            if plan is not None:
                pattern = _as_planned(pattern, plan, job)
            _describe(session, files[0], _finished(pattern, allowance), outputs, kind, job, None)
        return
    if outputs:
        raise ConfigError(f"--output takes one pattern, and {len(files)} are given")
    rows = []
    for number, path in enumerate(files, start=1):
        session.say(f"[{number}/{len(files)}] {path}")
        rows.append(_row(path, size, unit))
    from vto_pipeline.cli.tables import table_lines

    heads = ("file", "panels", "stitches", "worst mismatch", "verdict")
    common = os.path.commonpath([path.parent for path in files])
    session.answer({"files": rows}, table_lines(heads, [tuple(_cells(row, common)) for row in rows]))


def _files(paths: Sequence[Path]) -> list[Path]:
    """Return files, and in place of folders the patterns below them."""
    from vto_pipeline.io.patterns.read import PARSERS

    found: list[Path] = []
    for path in paths:
        inside = sorted(p for p in path.rglob("*") if p.suffix.lower() in PARSERS) if path.is_dir() else [path]
        if not inside:
            raise InputError(f"the folder holds no {', '.join(PARSERS)}", where=str(path))
        found += inside
    return found


def _grade(
    session: Session,
    path: Path,
    kind: str | None,
    sizes: Sequence[str],
    base: str,
    form: str,
    output: Path | None,
    unit: str | None,
) -> None:
    from vto_pipeline.cli.commands.pattern.graded import chart_lines, graded_facts
    from vto_pipeline.io.patterns.read import read_pattern
    from vto_pipeline.model.job import Job

    job = Job()
    pattern = read_pattern(path, unit=unit, job=job)
    facts = graded_facts(pattern, kind, sizes, base, f".{form}", output, job)
    lines = [*chart_lines(facts), *job.notes, *(f"written: {one}" for one in facts.get("written", ()))]
    session.answer({"path": str(path), **facts, "notes": job.notes}, lines)


def _describe(
    session: Session,
    path: Path,
    pattern: Pattern,
    outputs: Sequence[Path],
    kind: str | None,
    job: Job,
    taken: Unsewn | None,
) -> None:
    from vto_pipeline.cli.commands.pattern.flat_lines import flat_facts, flat_lines
    from vto_pipeline.cli.commands.pattern.lines import pattern_facts, pattern_lines
    from vto_pipeline.cli.commands.pattern.unsewn import unsewn_facts, unsewn_lines
    from vto_pipeline.io.patterns.panels_obj import write_panels_obj
    from vto_pipeline.io.patterns.write import write_pattern

    for output in outputs:
        if output.resolve() == path.resolve():
            raise ConfigError("the output would overwrite the input", where=str(output))
    for output in outputs:
        if taken is not None and output.suffix.lower() == ".obj":
            write_panels_obj(output, taken.mesh)
        else:
            write_pattern(output, pattern)
    flat = flat_facts(pattern, kind)
    facts = {"path": str(path), **pattern_facts(pattern), "flat": flat, "notes": job.notes}
    lines = [f"{path}: {pattern.name}, unit: {pattern.unit}", *pattern_lines(pattern), "", *flat_lines(flat), ""]
    if taken is not None:
        facts |= {"laid_flat": unsewn_facts(taken), "warnings": job.warnings}
        lines += [*unsewn_lines(facts["laid_flat"]), "", *(f"warning: {text}" for text in job.warnings)]
    if outputs:
        facts["written"] = str(outputs[0]) if len(outputs) == 1 else [str(one) for one in outputs]
    session.answer(facts, [*lines, *job.notes, *(f"written: {output}" for output in outputs)])


def _sized(pattern: Pattern, size: str | None) -> Pattern:
    return pattern if size is None else pattern.of_size(size)


def _finished(pattern: Pattern, allowance: float | None) -> Pattern:
    from vto_pipeline.garment.pattern.finish import finished

    return pattern if allowance is None else finished(pattern, 1e-3 * allowance)


def _as_planned(pattern: Pattern, plan: Path, job: Job) -> Pattern:
    from vto_pipeline.garment.pattern.planned import planned
    from vto_pipeline.io.patterns.sewing_plan import read_sewing_plan

    try:
        return planned(pattern, read_sewing_plan(plan), job)
    except InputError as e:
        raise InputError(e.problem, where=e.where or str(plan), hint=e.hint) from None


def _row(path: Path, size: str | None, unit: str | None) -> dict[str, Any]:
    from vto_pipeline.garment.pattern.figures import seam_figures
    from vto_pipeline.io.patterns.read import read_pattern

    try:
        pattern = _sized(read_pattern(path, unit=unit), size)
    except InputError as error:
        where = f" ({error.where})" if error.where and Path(error.where).name != path.name else ""
        return {"file": str(path), "refused": error.problem + where}
    seams = seam_figures(pattern.of_size(pattern.sizes[0])) if pattern.stitches else []
    worst = max(seams, key=lambda seam: abs(seam.mismatch), default=None)
    return {
        "file": str(path),
        "panels": len(pattern.panels),
        "sizes": list(pattern.sizes),
        "stitches": len(pattern.stitches),
        "worst_mismatch_mm": worst and abs(1e3 * worst.mismatch),
        "worst_mismatch_share": worst and worst.share,
    }


def _cells(row: dict[str, Any], folder: str) -> list[str]:
    name = os.path.relpath(row["file"], folder)  # long paths would be cut where they differ
    if "refused" in row:
        return [name, "", "", "", f"refused: {row['refused']}"]
    worst = row["worst_mismatch_mm"]
    said = "" if worst is None else f"{worst:.1f} mm, {row['worst_mismatch_share']:.1%}"
    return [name, str(row["panels"]), str(row["stitches"]), said, "read"]
