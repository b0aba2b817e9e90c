"""Wearing ease of each kind of garment, as a table with sources."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.documents import check_schema, load_yaml, suggest
from vto_pipeline.model.settings import Config

_TABLE = Path(__file__).with_name("allowances.yaml")


class AllowanceRow(Config):
    """One row of the table; without `high_cm` there is no upper bound."""

    garment: str
    zone: str
    low_cm: float
    high_cm: float | None = None
    source: str


class AllowanceTable(Config):
    """The whole table."""

    sources: dict[str, str]
    rows: list[AllowanceRow]


@dataclass(frozen=True)
class Allowance:
    """The wearing ease expected at one place.

    Args:
        low: [m].
        high: [m]; None for no upper bound.
        source: Who says so.
    """

    low: float
    high: float | None
    source: str


def known_kinds() -> list[str]:
    """Return the kinds of garment in the table."""
    return sorted({row.garment for row in _table().rows})


def read_allowances(garment: str) -> dict[str, Allowance]:
    """Return zone -> allowance for a kind of garment; rows for any garment fill the gaps.

    Raises:
        ConfigError: an unknown kind of garment.
    """
    table, kinds = _table(), known_kinds()
    if garment not in kinds:
        raise ConfigError(f"assess.garment: unknown kind (got {garment!r})", hint=suggest(garment, kinds))
    ranked = sorted(table.rows, key=lambda row: row.garment == garment)  # its own rows last, so that they win
    return {
        row.zone: Allowance(
            row.low_cm / 100, None if row.high_cm is None else row.high_cm / 100, table.sources[row.source]
        )
        for row in ranked
        if row.garment in ("any", garment)
    }


def _table() -> AllowanceTable:
    table: AllowanceTable = check_schema(load_yaml(_TABLE), AllowanceTable)
    return table
