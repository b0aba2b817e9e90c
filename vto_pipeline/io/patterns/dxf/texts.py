"""The words of an AAMA file: "PIECE NAME: FRONT", "SIZE: M", "UNITS: METRIC"."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.units import LENGTH_M

_UNITS = {
    **{"METRIC": "mm", "MM": "mm", "MILLIMETER": "mm", "MILLIMETRE": "mm", "CM": "cm", "CENTIMETER": "cm", "M": "m"},
    **{"ENGLISH": "in", "IMPERIAL": "in", "INCH": "in", "INCHES": "in", "IN": "in"},
}
_HEADER_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 14: "dm"}
"""$INSUNITS of DXF -> unit."""

_LONGEST_M = (0.2, 2.5)  # of the longest panel of a garment, where no unit is given
_GUESSED = ("mm", "cm", "in")


def key_and_value(text: str) -> tuple[str, str]:
    """Return the key of a text, in capitals, and its value; no key where there is no colon."""
    key, colon, value = text.partition(":")
    return (key.strip().upper(), value.strip()) if colon else ("", text.strip())


def find_unit(texts: Iterable[str], header: Any, sizes: Sequence[float], given: str) -> tuple[str, str]:
    """Return the unit of length, and how it is known.

    Args:
        texts: All of the file.
        header: Of ezdxf.
        sizes: Longest side of each piece, in the unit.
        given: By the user; empty: the file's.

    Raises:
        FormatError: texts contradict each other; InputError: there is none, and the size fits several units.
    """
    if given:
        return given, "as requested"
    stated = {value.upper() for key, value in map(key_and_value, texts) if key == "UNITS"}
    known = {_UNITS[word] for word in stated if word in _UNITS}
    if len(known) > 1:
        raise FormatError(f"texts name several units: {', '.join(sorted(stated))}", hint="give the unit: --unit mm")
    if known:
        return known.pop(), f"text UNITS: {sorted(stated)[0]}"
    code = header.get("$INSUNITS", 0)
    if code in _HEADER_UNITS:
        return _HEADER_UNITS[code], "$INSUNITS in the header"
    longest = max(sizes)
    low, high = _LONGEST_M
    fitting = [unit for unit in _GUESSED if low <= longest * LENGTH_M[unit] <= high]
    if len(fitting) != 1:
        what = f"fits {' and '.join(fitting)}" if fitting else f"fits none of {', '.join(_GUESSED)}"
        said = f"; UNITS: {', '.join(sorted(stated))} is unknown" if stated else ""
        problem = f"no text names the unit{said}, and the longest panel, {longest:.4g} units, {what}"
        raise InputError(problem, hint="give the unit: --unit mm")
    return fitting[0], f"guessed: no text names it, and the longest panel has {longest:.4g} units"
