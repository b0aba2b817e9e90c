"""A pattern in other sizes: a file for each, and the size chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vto_pipeline.cli.tables import table_lines
from vto_pipeline.errors import ConfigError
from vto_pipeline.garment.sizes.grade import SizeRow, grade
from vto_pipeline.garment.sizes.rules import SizeRules, guess_rules, read_rules
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.patterns.write import write_pattern
from vto_pipeline.io.size_charts import SIZE_CHART
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Pattern


def graded_facts(
    pattern: Pattern,
    kind: str | None,
    sizes: Sequence[str],
    base: str,
    suffix: str,
    output: Path | None,
    job: Job,
) -> dict[str, Any]:
    """Grade a pattern, write its sizes, and return the size chart as JSON values.

    Args:
        pattern: In one size or several.
        kind: Type of garment or a file of rules; None: its name suggests it.
        sizes: Letters.
        base: The size that the others are made from.
        suffix: Of the files: .dxf, .svg or .json.
        output: Folder for them and for the chart; None: nothing is written.
        job: Notified of what the format cannot hold.

    Raises:
        VtoError: the type or a size is unknown, or a panel cannot be graded.
    """
    if output is not None and output.exists() and not output.is_dir():
        raise ConfigError("expected a folder for the sizes, found a file", where=str(output))
    rules = guess_rules(pattern)[0] if kind is None else read_rules(kind)
    made, rows = grade(pattern, rules, base, sizes)
    chart = _chart(pattern.name, rules, base, rows)
    if output is None:
        return chart
    output.mkdir(parents=True, exist_ok=True)
    written = [output / f"{_file_name(pattern.name)}_{row.size}{suffix}" for row in rows]
    for path, row in zip(written, rows, strict=True):
        write_pattern(path, made.of_size(row.size))
    write_json(output / SIZE_CHART, chart)
    return {**chart, "written": [str(path) for path in (*written, output / SIZE_CHART)]}


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_ " else "_" for letter in name) or "pattern"


def _chart(name: str, rules: SizeRules, base: str, rows: Sequence[SizeRow]) -> dict[str, Any]:
    sizes = {
        row.size: {
            "made": row.made,
            "flat_mm": {key: 1e3 * one.value for key, one in row.flat.items()},
            "asked_mm": {key: 1e3 * value for key, value in row.asked.items()},
            "seam_mismatch_mm": 1e3 * row.mismatch,
        }
        for row in rows
    }
    head = {"schema": 1, "name": name, "type": rules.garment, "allowances": rules.allowances, "base": base}
    return {**head, "may_be_loose": rules.may_be_loose, "steps": rules.source, "sizes": sizes}


def chart_lines(chart: dict[str, Any]) -> list[str]:
    """Return a size chart as a table with a column a size, in cm, girths as halves."""
    sizes = chart["sizes"]
    names = list(dict.fromkeys(name for row in sizes.values() for name in row["flat_mm"]))
    rows = [(name.replace("_", " "), *(f"{row['flat_mm'][name] / 10:.1f}" for row in sizes.values())) for name in names]
    rows.append(("made", *(row["made"] for row in sizes.values())))
    off = [abs(row["flat_mm"][key] - value) for row in sizes.values() for key, value in row["asked_mm"].items()]
    seam = max(row["seam_mismatch_mm"] for row in sizes.values())
    heads = ("laid flat, cm", *sizes)
    said = f"at most {max(off, default=0.0):.1f} mm from what the rules ask for; seams fit as in {chart['base']} within"
    return [f"type: {chart['type']}", *table_lines(heads, rows), "", f"{said} {seam:.2f} mm"]
