"""What the exceptions of the native libraries say, in one line for a message of ours."""

from __future__ import annotations

import re

COLMAP_ERRORS = (RuntimeError, ValueError, IndexError)
"""What pycolmap raises when COLMAP cannot do something."""


def library_message(error: Exception) -> str:
    """Return the text of a library's exception without colours, source places and line breaks.

    That of OpenCV is taken from the exception alone: its `err` belongs to the class, and is what failed last anywhere.
    """
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    text = re.sub(r"^\[?(Open3D Error\] \(.*?\) \S+:\d+:|[\w./]+:\d+\])\s*", "", text.strip())
    text = re.sub(r"^OpenCV\(\S+\) \S*:-?\d+: error: \(-?\d+:[^)]*\)\s*", "", text)
    text = re.sub(r"\s*in function '[^']*'\s*(> )?|\n> ", " ", text)
    return " ".join(text.split()) or type(error).__name__
