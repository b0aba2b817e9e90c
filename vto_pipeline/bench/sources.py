"""The files that a figure depends on, and which of them have changed since it was measured.

A bench drives its module, and whatever that imports, inside functions too. Each file is kept under the name that git
gives its content, so that `git diff` shows what changed. Nothing is imported to find this out.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import vto_pipeline
from vto_pipeline.pipeline.execution.digest import SOURCE

ROOT = Path(vto_pipeline.__file__).parents[1]
_TABLES = ("vto_pipeline.bench", "vto_pipeline.stages")  # they name all there is; what is driven is asked for by name
_DATA = SOURCE - {".py"}


def sources_of(modules: Iterable[str], root: Path = ROOT) -> dict[str, str]:
    """Return path under the root -> name of its content, of all files of this package that modules need.

    Args:
        modules: Names such as "vto_pipeline.bench.collision".
        root: Folder of the package.
    """
    files = set[Path]()
    waiting, seen = list(modules), set[str]()
    while waiting:
        name = waiting.pop()
        if name in seen or (path := _file_of(name, root)) is None:
            continue
        seen.add(name)
        files |= {path, *_data_beside(path)}
        waiting.append(name.rpartition(".")[0])
        if name not in _TABLES:
            waiting += _imported(path, name)
    return contents_of(files, root)


def contents_of(files: Iterable[Path], root: Path = ROOT) -> dict[str, str]:
    """Return path under the root -> name of its content."""
    return {path.relative_to(root).as_posix(): content_name(path) for path in sorted(files)}


def changed_sources(document: Mapping[str, Any], root: Path = ROOT) -> list[str] | None:
    """Return which files of a results file's sources are different or gone now; None where it keeps none."""
    kept = document.get("sources")
    if kept is None:
        return None
    return [
        name for name, content in kept.items() if not (root / name).is_file() or content_name(root / name) != content
    ]


def content_name(path: Path) -> str:
    """Return what git calls the content of a file, as `git hash-object` prints it."""
    data = path.read_bytes()
    return hashlib.sha1(b"blob %d\0" % len(data) + data, usedforsecurity=False).hexdigest()


def _file_of(name: str, root: Path) -> Path | None:
    """Return the file of a module of this package; None where the name is another's, or that of something in one."""
    if name.partition(".")[0] != vto_pipeline.__name__:
        return None
    path = root.joinpath(*name.split("."))
    return next((file for file in (path / "__init__.py", path.with_suffix(".py")) if file.is_file()), None)


def _data_beside(path: Path) -> Iterator[Path]:
    """Yield the files that are no code in a package's folder, and in folders below that are no packages."""
    if path.name != "__init__.py":
        return
    for one in path.parent.iterdir():
        if one.suffix in _DATA:
            yield one
        elif one.is_dir() and not (one / "__init__.py").is_file():
            yield from (below for below in one.rglob("*") if below.suffix in _DATA)


@cache
def _imported(path: Path, name: str) -> tuple[str, ...]:
    """Return the modules that one imports, and the names it takes from them, which may be modules."""
    found = list[str]()
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import):
            found += [one.name for one in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [node.module or "", *(f"{node.module}.{one.name}" for one in node.names)]
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            waiting += node.orelse
        else:
            waiting += ast.iter_child_nodes(node)
    return tuple(found)
