"""Letter sizes of EN 13402-3: the range of chest or bust girth of each."""

from __future__ import annotations

from vto_pipeline.errors import InputError

_LETTERS = ("XXS", "XS", "S", "M", "L", "XL", "XXL", "3XL", "4XL", "5XL")
_OTHER_WRITING = {"2XS": "XXS", "2XL": "XXL", "XXXL": "3XL", "XXXXL": "4XL", "XXXXXL": "5XL"}
# where one letter ends and the next begins; two public transcriptions of the standard's table agree
_BORDERS_CM = {
    "female": (66, 74, 82, 90, 98, 107, 119, 131, 143, 155, 167),
    "male": (70, 78, 86, 94, 102, 110, 118, 129, 141, 154, 166),
}


def chest_range(letter: str, sex: str) -> tuple[float, float]:
    """Return the least and the greatest chest girth (women: bust girth) of a letter [m].

    Raises:
        InputError: no such letter, or a sex the standard has no letters for.
    """
    if sex not in _BORDERS_CM:
        raise InputError(f"size {letter} of sex {sex!r}: size letters differ between women and men", hint="set sex:")
    at = letter_number(letter)
    low, high = _BORDERS_CM[sex][at : at + 2]
    return low / 100, high / 100


def letter_number(letter: str) -> int:
    """Return which in the row of letters a size is; one more is the next larger size.

    Raises:
        InputError: no such letter.
    """
    written = letter.strip().upper()
    written = _OTHER_WRITING.get(written, written)
    if written not in _LETTERS:
        raise InputError(f"size {letter!r} is not known; expected {', '.join(_LETTERS)}")
    return _LETTERS.index(written)
