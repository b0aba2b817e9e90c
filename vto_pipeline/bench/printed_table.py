"""A table in Markdown on stdout, a row as soon as it is there."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence

from vto_pipeline.errors import VtoError


def print_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> int:
    """Print heads and rows; return the exit code, that of an error which ends them, with the error on stderr."""
    try:
        for row in (heads, ("---",) * len(heads)):
            sys.stdout.write(f"| {' | '.join(row)} |\n")
        for row in rows:
            sys.stdout.write(f"| {' | '.join(row)} |\n")
            sys.stdout.flush()
    except VtoError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return 0
