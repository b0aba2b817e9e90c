"""The files beside a mesh that are read with it: materials and pictures of OBJ, buffers and pictures of glTF."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

from vto_pipeline.errors import FormatError
from vto_pipeline.io.formats.mtl import find_beside, library_files, named_pictures

_LARGEST_TREE = 100_000_000  # bytes of JSON; a file of that size holds its buffers itself
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t](.*)$", re.MULTILINE)


def companions(path: Path) -> dict[str, Path]:
    """Return the files that belong to a mesh file and are there, by their names from its folder; else none."""
    found = {".obj": _of_obj, ".gltf": _of_gltf}.get(path.suffix.lower())
    if found is None or not path.is_file():
        return {}
    folder = path.resolve().parent
    return {file.relative_to(folder).as_posix(): file for file in found(path)}


def _of_obj(path: Path) -> Iterator[Path]:
    names = [line.decode("utf-8", errors="replace").strip() for line in _LIBRARY.findall(path.read_bytes())]
    for library in library_files(path, names):
        yield library
        try:
            yield from named_pictures(path, library)
        except FormatError:  # the reader says so
            continue


def _of_gltf(path: Path) -> Iterator[Path]:
    from urllib.parse import unquote

    if path.stat().st_size > _LARGEST_TREE:
        return
    try:
        tree = json.loads(path.read_bytes().decode("utf-8-sig"))
        named = [one["uri"] for key in ("buffers", "images") for one in tree.get(key, []) if "uri" in one]
    except (ValueError, RecursionError, AttributeError, TypeError):  # the reader says what is wrong
        return
    for uri in named:
        if isinstance(uri, str) and not uri.startswith("data:"):
            file = find_beside(path, unquote(uri))
            if file is not None:
                yield file
