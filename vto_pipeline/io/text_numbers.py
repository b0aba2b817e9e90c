"""Numbers in text files, with the line of the first token that is not a number."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.model.arrays import FloatArray


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
    """All numbers of some lines, in order.

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
    for line, number in zip(lines, line_numbers, strict=True):
        for token in line.split():
            if not _is_number(token):
                hint = "write numbers with a decimal point, not a comma" if "," in token else ""
                raise FormatError(f"{token[:40]!r} is not a number", where=f"{path}, line {number}", hint=hint)
    raise FormatError("a token is not a number", where=str(path))


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


def _is_number(token: str) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True
