"""Numbers in text files, with the line of the first token that is not a number."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.model.arrays import FloatArray

_NOT_FINITE = re.compile(r"[+-]?(1\.#[a-z]+\d*|nan\([a-z]+\))", re.I)
"""What Windows' C libraries print for numbers that are none, old and new: 1.#QNAN0, -1.#IND00, 1.#INF00, -nan(ind)."""


def read_lines(path: Path) -> list[str]:
    """The lines of a text file.

    Raises:
        FormatError: it holds bytes that are no text.
    """
    data = path.read_bytes()
    if b"\0" in data:
        raise FormatError(f"byte {data.index(0)} is zero: this is not a text file", where=str(path))
    return data.decode("utf-8", errors="replace").splitlines()


def parse_numbers(lines: Sequence[str], line_numbers: Sequence[int], path: Path) -> FloatArray:
    """All numbers of some lines, in order; what any C library prints for one that is not finite counts as one.

    Args:
        lines: Text, numbers apart by white space.
        line_numbers: Where each line stands in the file, counted from 1.
        path: The file, for messages.

    Returns:
        The numbers, shape (N,).

    Raises:
        FormatError: a token is not a number.
    """
    try:
        return np.fromiter(map(float, " ".join(lines).split()), dtype=np.float64)
    except ValueError:
        pass
    found = []
    for line, number in zip(lines, line_numbers, strict=True):
        for token in line.split():
            try:
                found.append(_number(token))
            except ValueError:
                hint = "write numbers with a decimal point, not a comma" if "," in token else ""
                problem = f"{token[:40]!r} is not a number"
                raise FormatError(problem, where=f"{path}, line {number}", hint=hint) from None
    return np.array(found, dtype=np.float64)


def parse_rows(lines: Sequence[str], line_numbers: Sequence[int], path: Path) -> FloatArray:
    """Return the numbers of lines that must all have the same count.

    Returns:
        Shape (len(lines), columns); (0, 0) of no lines.

    Raises:
        FormatError: a token is not a number, or a line is shorter or longer than the first.
    """
    values = parse_numbers(lines, line_numbers, path)
    counts = [len(line.split()) for line in lines]
    for count, number in zip(counts, line_numbers, strict=True):
        if count != counts[0]:
            problem = f"{count} numbers in this line, {counts[0]} in the lines before"
            raise FormatError(problem, where=f"{path}, line {number}", hint="is the file truncated?")
    return values.reshape(len(lines), counts[0] if counts else 0)


def _number(token: str) -> float:
    if not _NOT_FINITE.fullmatch(token):
        return float(token)
    return math.copysign(math.inf if "inf" in token.lower() else math.nan, -1.0 if token.startswith("-") else 1.0)
