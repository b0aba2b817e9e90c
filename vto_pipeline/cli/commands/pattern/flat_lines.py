"""Flat measurements of a sewing pattern, of each of its sizes, in a table and as JSON."""

from __future__ import annotations

from typing import Any

from vto_pipeline.cli.tables import table_lines
from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.sizes.flat import HALVES, flat_measurements
from vto_pipeline.garment.sizes.rules import guess_rules, read_rules
from vto_pipeline.model.pattern import Pattern


def flat_facts(pattern: Pattern, kind: str | None) -> dict[str, Any]:
    """Return flat measurements as JSON values.

    Args:
        pattern: In any sizes.
        kind: Type of garment or a file of rules, as the user states it; None: its name suggests it.

    Returns:
        "type", "because", and "sizes": size -> name -> {"mm", "half_of_a_girth", "found"}; or "unknown", the reason why
        nothing could be measured.

    Raises:
        ConfigError: no such type. GarmentError: the pattern is none of the stated type.
    """
    try:
        rules, reason = guess_rules(pattern) if kind is None else (read_rules(kind), "as stated")
        sizes = {
            size: {
                name: {"mm": 1e3 * one.value, "half_of_a_girth": name in HALVES, "found": one.found}
                for name, one in flat_measurements(pattern.of_size(size), rules).items()
            }
            for size in pattern.sizes
        }
    except GarmentError as error:
        if kind is not None:
            raise
        return {"unknown": f"{error.problem}; {error.hint}"}
    return {"type": rules.garment, "because": reason, "sizes": sizes}


def flat_lines(facts: dict[str, Any]) -> list[str]:
    """Return flat measurements as a table with a column a size, in mm."""
    if "unknown" in facts:
        return [f"no flat measurements: {facts['unknown']}"]
    sizes = facts["sizes"]
    names = list(dict.fromkeys(name for found in sizes.values() for name in found))
    rows = []
    for name in names:
        values = [f"{found[name]['mm']:.1f}" if name in found else "-" for found in sizes.values()]
        where = next(found[name]["found"] for found in sizes.values() if name in found)
        rows.append((name.replace("_", " "), *values, where))
    heads = ("laid flat", *(f"{size} mm".strip() for size in sizes), "where")
    return [f"type: {facts['type']}, {facts['because']}", *table_lines(heads, rows)]
