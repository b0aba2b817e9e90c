"""What a run found, in words: girths with their uncertainty, and how a garment fits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from vto_pipeline.cli.tables import table_lines
from vto_pipeline.model.body import Measurements
from vto_pipeline.pipeline.catalogue import Catalogue

_COVERED = 1.96
"""Standard deviations on either side that hold 95 % of a normal distribution."""


def result_lines(wanted: Iterable[str], out: Path, tables: Catalogue) -> Iterator[str]:
    """Yield the result of each wanted artifact that has one in words.

    Args:
        wanted: Artifacts.
        out: RUN/out.
        tables: For their files.
    """
    for artifact in wanted:
        kind = tables.kind(artifact)
        if artifact == "measurements":
            yield from table_lines(("girth", "cm", "± cm (95 %)"), _girths(kind.read(out / kind.filename)))
    yield from verdicts(wanted, out, tables)


def verdicts(wanted: Iterable[str], out: Path, tables: Catalogue) -> Iterator[str]:
    """Yield how each garment fits, in words.

    Args: See `result_lines`.
    """
    for artifact in wanted:
        if artifact.endswith("fit_report"):
            kind, garment = tables.kind(artifact), artifact.removesuffix("fit_report").rstrip("_")
            yield f"fit{f' of {garment}' if garment else ''}: {kind.read(out / kind.filename)['verdict']}"


def _girths(measured: Measurements) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and half the 95 % interval of stature and of each girth; "-" where that is unknown."""
    for name, value in measured.values.items():
        if name == "stature" or name.endswith("_girth"):
            sigma = measured.sigmas.get(name)
            spread = "-" if sigma is None else f"{100 * _COVERED * sigma:.1f}"
            yield name.removesuffix("_girth").replace("_", " "), f"{100 * value:.1f}", spread
